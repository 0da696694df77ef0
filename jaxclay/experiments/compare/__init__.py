"""Methods side by side: scenes, runner, results, charts, report (extra ``compare``)."""
