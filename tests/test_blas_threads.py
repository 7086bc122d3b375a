"""Linear algebra runs on one thread inside the verbs and has the caller's setting back behind them."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import bayesid
from bayesid.threads import one_blas_thread


def blas_threads():
    return [lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"]


def test_one_thread_inside_and_the_callers_setting_behind_also_after_an_error():
    if not blas_threads():
        pytest.skip("no BLAS library that can be asked")
    np.ones((2, 2)) @ np.ones((2, 2))

    @one_blas_thread
    def count(fail=False):
        if fail:
            raise ValueError("stop")
        return blas_threads()

    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        assert set(count()) == {1}
        with pytest.raises(ValueError, match="stop"):
            count(fail=True)
        assert blas_threads() == before


def test_every_verb_that_computes_holds_it_and_keeps_its_signature():
    for name in ("fit", "sample", "diagnose", "identify", "predict", "excite", "compare", "design"):
        verb = getattr(bayesid, name)
        assert verb.__wrapped__.__name__ == name == verb.__name__ and verb.__doc__
