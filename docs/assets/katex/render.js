// Formulae of a page, also after a page was loaded without a reload.
document$.subscribe(({ body }) => renderMathInElement(body, {
  delimiters: [{ left: "\\(", right: "\\)", display: false }, { left: "\\[", right: "\\]", display: true }],
}));
