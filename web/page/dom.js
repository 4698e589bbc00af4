// Small pieces of a page.

export const by = (id) => document.getElementById(id);

/** Makes an element; `content` is text or elements, never markup. */
export function make(name, attributes = {}, ...content) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (typeof value === "boolean") made.toggleAttribute(key, value);
    else if (value !== undefined) made.setAttribute(key, value);
  }
  made.append(...content.filter((piece) => piece !== undefined));
  return made;
}

/** Makes a list to choose from; `choices` are pairs of value and words, or groups of such with a name. */
export function select(attributes, choices, chosen) {
  const option = ([value, words]) => make("option", { value, selected: value === chosen }, words);
  const group = ({ name, choices: own }) => make("optgroup", { label: name }, ...own.map(option));
  return make("select", attributes, ...choices.map((choice) => (Array.isArray(choice) ? option(choice) : group(choice))));
}

/** Gives a file to whoever looks at the page. */
export function download(name, bytes, type = "application/octet-stream") {
  const url = URL.createObjectURL(new Blob([bytes], { type }));
  const link = make("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** A number as people write it, with this number of significant digits. */
export const digits = (value, count = 4) => (Number.isFinite(value) ? String(Number(value.toPrecision(count))) : "–");
