from __future__ import annotations

from benchmarks import view


def test_the_data_path_is_measured(monkeypatch):
    monkeypatch.setattr(view, "SECONDS", 0.5)
    rate, size, busy, packing = view.data_path(100)
    assert rate > 1
    assert 8 * 100 / 1e6 < size < 16 * 100 / 1e6 + 4e-3  # [MB]: u16 places, and the head
    assert min(busy, packing) > 0


def test_the_first_frame_is_waited_for():
    passed, busy = view.first_frame("pendulum")
    assert passed > 0
    assert busy > 0
