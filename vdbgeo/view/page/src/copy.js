// Copy buttons: a table as text with tabs, anything else as its text.

const cell_text = (cell) => cell.innerText.replace(/\s+/g, " ").trim();

export function text_of(element) {
  if (element.tagName !== "TABLE") return element.innerText ?? element.textContent;
  return [...element.rows].map((row) => [...row.cells].map(cell_text).join("\t")).join("\n") + "\n";
}

// For pages that may not use the clipboard.
function copy_by_selection(text) {
  const area = document.createElement("textarea");
  area.value = text;
  area.className = "off-screen";
  document.body.append(area);
  area.select();
  const done = document.execCommand("copy");
  area.remove();
  return done;
}

async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    return copy_by_selection(text);
  }
}

export function start_copy(button, status) {
  const words = button.textContent;
  let timer = 0;
  button.addEventListener("click", async () => {
    const element = document.getElementById(button.dataset.copy);
    const done = element !== null && await copy(text_of(element));
    button.focus();
    button.textContent = done ? "Copied" : "Not copied";
    status.textContent = done ? "Copied to the clipboard" : "The browser did not allow copying";
    clearTimeout(timer);
    timer = setTimeout(() => { button.textContent = words; status.textContent = ""; }, 2000);
  });
}
