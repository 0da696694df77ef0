"""Comparison experiments: scenes, runner, results, charts, report (extra ``compare``)."""
