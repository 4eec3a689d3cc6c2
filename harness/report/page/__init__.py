"""One HTML file of a results folder, or of a folder of them: tables, curves, pictures and records to explore offline.

:mod:`.report.page.gather` collects what the page shows from the tidy tables, :mod:`.report.page.pictures` what it draws
from files, and :mod:`.report.page.build` puts both into the template of ``web/``. Ratios are made here, by
:mod:`.report.compare`; the page only shows them.
"""
