from __future__ import annotations

import threading

from mocoflow_core.io.locks import holding, is_held


def test_a_lock_is_held_for_the_block_and_free_afterwards(tmp_path):
    path = tmp_path / "deep" / "key.lock"
    assert not is_held(path)
    with holding(path) as mine:
        assert mine
        assert is_held(path)
        with holding(path, wait=False) as another:
            assert not another
    assert not is_held(path)


def test_who_waits_for_a_lock_whose_file_is_removed_takes_the_lock_of_that_name_anew(tmp_path):
    """Else two processes could hold what both take for the same lock."""
    path, inside, release = tmp_path / "key.lock", threading.Event(), threading.Event()

    def wait_for_it():
        with holding(path):
            inside.set()
            release.wait(20.0)

    waiting = threading.Thread(target=wait_for_it)
    with holding(path):
        waiting.start()
        assert not inside.wait(0.2)
        path.unlink()
    try:
        assert inside.wait(20.0)
        assert is_held(path)
    finally:
        release.set()
        waiting.join()
