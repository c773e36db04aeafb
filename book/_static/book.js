// Search results show an excerpt of each page, which must be fetched; pages opened from disk cannot.
if (location.protocol === "file:") {
  DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
}

// On a phone a wide table of sentences is read entry by entry: each cell says which column it is.
// What is a table for the eye stays one for screen readers.
document.addEventListener("DOMContentLoaded", () => {
  for (const table of document.querySelectorAll(".bd-article table")) {
    // Formulas are not set yet: a label shows their letters.
    const plain = (text) => text.replace(/\\\((.*?)\\\)/g, (_, tex) => tex.replace(/[\\{}]/g, ""));
    const heads = [...table.querySelectorAll("thead th")].map((head) => plain(head.textContent.trim()));
    const rows = [...table.querySelectorAll("tbody tr")];
    const wordy = rows.some((row) => [...row.cells].some((cell) => cell.textContent.length > 45));
    if (heads.length < 3 || !wordy || table.querySelector("[rowspan], [colspan]")) continue;
    table.classList.add("book-entries");
    table.setAttribute("role", "table");
    for (const part of table.querySelectorAll("thead, tbody")) part.setAttribute("role", "rowgroup");
    for (const row of table.rows) row.setAttribute("role", "row");
    for (const head of table.querySelectorAll("thead th")) head.setAttribute("role", "columnheader");
    for (const row of rows) {
      [...row.cells].forEach((cell, k) => {
        cell.setAttribute("role", cell.tagName === "TH" ? "rowheader" : "cell");
        cell.dataset.head = heads[k] || "";
      });
    }
  }
});

// What scrolls must be reachable by keyboard: wide formulas, once they are set and again when the
// window changes. A box in a checklist is named by the line it stands in.
const reachable = () => {
  for (const formula of document.querySelectorAll('mjx-container[display="true"]')) {
    const wide = formula.scrollWidth > formula.clientWidth;
    if (wide) formula.setAttribute("tabindex", "0");
    else if (formula.getAttribute("tabindex") === "0") formula.removeAttribute("tabindex");
  }
};
window.addEventListener("load", async () => {
  await window.MathJax?.startup?.promise;
  reachable();
});
window.addEventListener("resize", reachable);
document.addEventListener("DOMContentLoaded", () => {
  for (const box of document.querySelectorAll(".task-list-item-checkbox")) {
    box.setAttribute("aria-label", box.closest("li").textContent.trim());
  }
});

// The ledger: filter by verdict, order and words, sort, open all; a link to a row opens it.
document.addEventListener("DOMContentLoaded", () => {
  for (const box of document.querySelectorAll(".claims")) {
    const form = box.querySelector(".claims-controls");
    const rows = [...box.querySelectorAll("details.claim")];
    if (!form || rows.length < 2) continue;
    form.hidden = false;
    const by = { row: "row", verdict: "kind", seeds: "seeds" };
    const update = () => {
      const { verdict, order, changed, sort, words, shown, open } = form.elements;
      const wanted = words.value.trim().toLowerCase();
      let count = 0;
      for (const row of rows) {
        const fits = (!verdict.value || row.dataset.verdict === verdict.value)
          && (!order.value || row.dataset.order === order.value)
          && (!changed.checked || row.dataset.changed === "1")
          && (!wanted || row.textContent.toLowerCase().includes(wanted));
        row.hidden = !fits;
        count += fits;
      }
      const key = by[sort.value];
      const value = (row) => Number(row.dataset[key]);
      const sorted = [...rows].sort((a, b) => value(a) - value(b) || a.dataset.row - b.dataset.row);
      box.append(...sorted);
      shown.value = `${count} of ${rows.length} rows`;
      open.textContent = rows.every((row) => row.hidden || row.open) ? "close all" : "open all";
    };
    form.addEventListener("input", update);
    form.addEventListener("submit", (event) => event.preventDefault());
    form.elements.open.addEventListener("click", () => {
      const opening = form.elements.open.textContent === "open all";
      for (const row of rows) if (!row.hidden) row.open = opening;
      update();
    });
    update();
  }
  const opened = () => {
    const row = location.hash.startsWith("#claim-") && document.getElementById(location.hash.slice(1));
    if (row?.matches?.("details")) {
      row.hidden = false;
      row.open = true;
      row.scrollIntoView();
    }
  };
  window.addEventListener("hashchange", opened);
  opened();
});
