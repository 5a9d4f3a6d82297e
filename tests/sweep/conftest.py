from concurrent.futures import ThreadPoolExecutor

import pytest

from skfem_textile.sweep import WorkerProcesses
from tests.helpers.sweep_cases import process_pool

KINDS = {
    "threads": (ThreadPoolExecutor, 2),
    "process pool": (process_pool, 1),
    "workers": (WorkerProcesses, 2),
}


@pytest.fixture
def client():
    distributed = pytest.importorskip("dask.distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0"}
    with (
        distributed.LocalCluster(processes=True, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture(params=KINDS, scope="module")
def executor(request):
    """Executors that tests share; their processes start with as many threads as cores.

    Failures and deaths in earlier tests do not impair them.
    """
    with pytest.MonkeyPatch.context() as environment:
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            environment.delenv(name, raising=False)
        kind, number = KINDS[request.param]
        with kind(number) as executor:
            yield executor


@pytest.fixture
def thread():
    with ThreadPoolExecutor(1) as executor:
        yield executor
