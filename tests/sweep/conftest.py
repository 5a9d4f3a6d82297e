from concurrent.futures import ThreadPoolExecutor

import pytest
from sweep_cases import process_pool

from skfem_textile.sweep import WorkerProcesses

KINDS = {
    "threads": ThreadPoolExecutor,
    "process pool": process_pool,
    "workers": WorkerProcesses,
}


@pytest.fixture(scope="session")
def client():
    distributed = pytest.importorskip("dask.distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0"}
    with (
        distributed.LocalCluster(processes=True, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture(params=[*KINDS, "dask"])
def executor(request):
    if request.param == "dask":
        executor = request.getfixturevalue("client").get_executor()
    else:
        executor = KINDS[request.param](2)
    with executor:
        yield executor


@pytest.fixture
def thread():
    with ThreadPoolExecutor(1) as executor:
        yield executor
