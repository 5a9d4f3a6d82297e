"""Draping: public names of surfaces, nets and their figures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub("skfem_textile", __file__)
