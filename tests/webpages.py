"""Pages in a browser that playwright drives."""

from pathlib import Path
from typing import Any


class Opened:
    """A page that was opened from the disk without a network, with what went wrong in it."""

    def __init__(self, browser: Any, path: Path, fragment: str = "", **context: Any) -> None:
        self.context = browser.new_context(
            **{"viewport": {"width": 1000, "height": 600}, "accept_downloads": True} | context
        )
        self.page = self.context.new_page()
        self.requests: list[str] = []
        self.errors: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        self.page.goto(path.as_uri() + fragment)
        self.page.wait_for_selector("html[data-ready], html[data-failed]", timeout=120_000)
        assert self.page.evaluate("document.documentElement.dataset.failed ?? ''") == ""

    def __call__(self, script: str, argument: Any = None) -> Any:
        """Result of a script in the page; `explorer` is the running program."""
        return self.page.evaluate(script, argument)
