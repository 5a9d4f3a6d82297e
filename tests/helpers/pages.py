"""Pages of results, as tests read them."""

import re
from html.parser import HTMLParser

VOID = {"meta", "link", "img", "br", "wbr"}


class Page(HTMLParser):
    """Elements, sources and text of a page whose elements all close."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.sources, self.text = [], [], [], ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.sources += [v for k, v in attrs if k in ("src", "href", "srcset", "data")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def references(file):
    """References of a page to anything outside it, and scripts."""
    text = file.read_text(encoding="utf-8")
    page = Page(text)
    assert page.sources
    css = re.search(r"<style>(.*?)</style>", text, re.S)[1]
    outside = [x for x in page.sources if not x.startswith("data:")]
    outside += [word for word in ("url(", "@import") if word in css]
    plain = re.sub(r'"data:[^"]*"', "", text)
    return outside + re.findall("://", plain) + [x for x in page.tags if x == "script"]
