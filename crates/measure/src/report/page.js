for (const box of document.querySelectorAll("details")) {
  const table = box.querySelector("table"), button = box.querySelector(".csv");
  if (!table || !button) continue;
  const heads = [...table.tHead.rows[0].cells], body = table.tBodies[0];
  const value = cell => cell && cell.dataset.v !== undefined ? Number(cell.dataset.v) : null;
  heads.forEach((head, column) => {
    head.tabIndex = 0;
    head.setAttribute("aria-sort", "none");
    const sort = () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      heads.forEach(h => h.setAttribute("aria-sort", "none"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const rows = [...body.rows].sort((a, b) => {
        const [x, y] = [value(a.cells[column]), value(b.cells[column])];
        const text = cell => cell ? cell.textContent : "";
        if (x === null || y === null) return (x === null) - (y === null) || text(a.cells[column]).localeCompare(text(b.cells[column]));
        return x - y;
      });
      body.append(...(down ? rows.reverse() : rows));
    };
    head.onclick = sort;
    head.onkeydown = e => { if (e.key === "Enter" || e.key === " ") { e.preventDefault(); sort(); } };
  });
  // Numbers have all digits, and errors have a column of their own. A text that a spreadsheet would run is quoted.
  const quote = text => {
    const safe = /^[=+@\t\r-]/.test(text) && isNaN(Number(text)) ? "'" + text : text;
    return /[",\n\r]/.test(safe) ? '"' + safe.replace(/"/g, '""') + '"' : safe;
  };
  button.hidden = false;
  button.onclick = async () => {
    const rows = [...body.rows], withError = heads.map((_, i) => rows.some(r => r.cells[i] && r.cells[i].dataset.e !== undefined));
    const line = cells => cells.map(quote).join(",");
    const head = line(heads.flatMap((h, i) => withError[i] ? [h.textContent, h.textContent + ", error"] : [h.textContent]));
    const text = [head, ...rows.map(r => line([...r.cells].flatMap((c, i) => {
      const shown = c.dataset.v !== undefined ? c.dataset.v : c.textContent;
      return withError[i] ? [shown, c.dataset.e || ""] : [shown];
    })))].join("\n") + "\n";
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const area = document.createElement("textarea");
      area.value = text;
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = "Copy as CSV"; }, 1500);
  };
}
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach(d => { d.open = true; }));
