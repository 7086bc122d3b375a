"""A replay in a report runs its own script and no other, and no text of its data ends its element."""

import base64
import hashlib
import json
import re

from bayesid.report import writer
from bayesid.report.writer import Replay, Report, Section, Text

SERIES = {
    "label": "</script><b>log",
    "colour": "#000",
    "dash": [],
    "x": [0.0, None],
    "y": [0.0, 1.0],
    "psi": None,
}
FORCE = {
    "label": "as given",
    "colour": "#777",
    "dash": [],
    "X": [1.0, None],
    "Y": [0.0, 1.0],
    "N": [0.0, 0.0],
}
DATA = {"t": [0.0, 1.0], "series": [SERIES], "orders": [], "forces": [FORCE]}


def page(tmp_path, *first):
    report = Report("pond", "lead", [Section("one", [Text("words")])], first=first)
    return writer.write(report, tmp_path, {}).read_text(encoding="utf-8")


def test_the_policy_allows_the_script_of_the_replay_and_nothing_else(tmp_path):
    text = page(tmp_path, Replay(DATA))
    allowed = re.findall(r"script-src '(\S+)'", text)
    scripts = [
        s for kind, s in re.findall(r"<script([^>]*)>(.*?)</script>", text, re.S) if "json" not in kind
    ]
    digest = [base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts]
    assert len(scripts) == 1 and allowed == [f"sha256-{digest[0]}"]
    assert "default-src 'none'" in text and "http" not in scripts[0]


def test_a_name_in_the_data_cannot_end_the_element(tmp_path):
    text = page(tmp_path, Replay(DATA))
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', text, re.S)
    assert json.loads(data) == DATA and "<" not in data


def test_a_report_without_a_replay_has_no_script_and_allows_none(tmp_path):
    text = page(tmp_path)
    assert "<script" not in text and "script-src" not in text
