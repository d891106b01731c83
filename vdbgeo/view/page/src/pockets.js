// Rows of the tables of pockets are buttons that show the pocket.

/** `choose(number)` is called with a pocket's number, or with null when none is chosen any more. */
export function start_pockets(tables, pockets, choose) {
  const rows = new Map();
  let chosen = null;
  const mark = (number) => {
    for (const [n, row] of rows) row.setAttribute("aria-selected", n === number);
    chosen = number;
    choose(number);
  };
  for (const row of tables.flatMap((table) => [...table.querySelectorAll("tr[data-pocket]")])) {
    const number = Number(row.dataset.pocket);
    if (!pockets.some((p) => p.id === number)) continue;
    rows.set(number, row);
    row.tabIndex = 0;
    row.classList.add("choice");
    row.setAttribute("aria-selected", false);
    row.addEventListener("click", () => { if (!getSelection()?.toString()) mark(number); });
    row.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      mark(number);
    });
  }
  if (!rows.size) return;
  for (const table of tables) {
    table.setAttribute("role", "grid");  // rows of plain tables cannot be selected
    table.setAttribute("aria-label", "Pockets. Enter on a row shows the pocket in the viewer, Escape leaves it");
  }
  document.addEventListener("keydown", (event) => { if (event.key === "Escape" && chosen !== null) mark(null); });
}
