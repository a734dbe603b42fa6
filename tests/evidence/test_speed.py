"""The benchmark measures what it says; how fast the kit is belongs to benchmarks, not to tests."""

from windwrench.evidence.speed import BEGIN, END, HEADER, SECONDS, Contender, rows, study


def test_medians_and_ratios_are_taken_round_by_round():
    values = iter([1.0, 10.0, 2.0, 10.0, 3.0, 60.0])
    one, two = (Contender(name, SECONDS, "x", lambda: next(values)) for name in ("one", "two"))
    assert rows([one, two], 3) == [
        "| one | 2 s | 1 - 3 | 1 (1 - 1) | x |",
        "| two | 10 s | 10 - 60 | 10 (5 - 20) | x |",
    ]


def test_a_page_gets_the_table_anew(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}old\n{END}\nafter\n", encoding="utf-8")
    study(["filters"], 1, page)
    text = page.read_text(encoding="utf-8")
    assert text.startswith(f"before\n{BEGIN}{HEADER}\n")
    assert "\nMade by `python -m evidence.speed filters --rounds 1`" in text
    assert text.endswith(f"\n{END}\nafter\n")
    assert "\n| WrenchUKFBatch, single | " in text
    assert "old" not in text
