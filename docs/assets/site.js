// What scrolls can be reached by the keyboard; the search says what it is.
document$.subscribe(() => {
  document.querySelectorAll(".md-typeset__scrollwrap, .highlight-ipynb").forEach(e => { e.tabIndex = 0; });
  document.querySelector(".md-search")?.setAttribute("aria-label", document.querySelector(".md-search__input")?.ariaLabel || "Search");
});
