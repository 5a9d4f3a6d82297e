// Points of the search results.  Sphinx does not distinguish the title of a page from the
// headings of its sections, nor a class from the attributes of others with its name.
const WHOLE_TITLE = 8; // all words are in the title of the page, or of a section
const GUIDE = 4; // a page of instructions
const OWN_PAGE = 14; // the name of a class or a function, with the same capitals

const searched = new URLSearchParams(window.location.search).get("q") || "";
const words = searched.toLowerCase().match(/\S+/g) || [];

var Scorer = {
  score: ([page, title, anchor, , points]) => {
    if (page.includes("/generated/"))
      return points + (!anchor && title.endsWith(`.${searched.trim()}`) ? OWN_PAGE : 0);
    const whole = words.every((word) => title.toLowerCase().includes(word));
    const guide = /^(how-to|tutorial)\//.test(page);
    return points + (whole ? WHOLE_TITLE : 0) + (guide ? GUIDE : 0);
  },
  // The values of Sphinx.
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
