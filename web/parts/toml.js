// Splits TOML into coloured pieces, line by line. It need not judge: the server does.
// A line depends only on its text and on whether a long string is open before it, so
// the editor colours again only the lines that changed.

const PIECES = [
  ["comment", /#.*/y],
  ["long", /"""|'''/y],
  ["text", /"(?:[^"\\]|\\.)*"?|'[^']*'?/y],
  [
    "number",
    /[+-]?(?:0x[\da-fA-F_]+|0o[0-7_]+|0b[01_]+|(?:inf|nan)\b|\d[\d_]*(?:\.[\d_]+)?(?:[eE][+-]?\d+)?(?:[-:T]\d[\d:.TZ+-]*)?)(?![\w-])/y,
  ],
  ["number", /(?:true|false)\b/y],
  ["plain", /[\w-]+|\s+|./uy],
];
const TABLE = /^(\s*)(\[\[?[^\]#]*\]?\]?)(.*)$/;
const KEY = /^(\s*)((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)(?=\s*=)/;
const INNER_KEY = /([\w-]+)(?=\s*=)/y;

/**
 * Pieces of a line as [kind, text], and what is open after it: "" or the quotes of a
 * long string. `depth` is not known to a line alone, so `[` at its start counts as a
 * table's name only where nothing but a name stands between the brackets.
 */
export function colourLine(line, open) {
  const out = [];
  let at = 0;
  if (open) {
    const end = line.indexOf(open);
    if (end < 0) return { pieces: [["text", line]], open };
    at = end + 3;
    out.push(["text", line.slice(0, at)]);
    open = "";
  } else {
    const table = TABLE.exec(line);
    if (table && /^\[\[?\s*[\w.\-"' ]+\s*\]\]?$/.test(table[2]) && /^\s*(#.*)?$/.test(table[3])) {
      out.push(["plain", table[1]], ["head", table[2]]);
      at = table[1].length + table[2].length;
    } else {
      const key = KEY.exec(line);
      if (key) {
        out.push(["plain", key[1]], ["key", key[2]]);
        at = key[0].length;
      }
    }
  }
  while (at < line.length) {
    INNER_KEY.lastIndex = at;
    const inner = INNER_KEY.exec(line);
    if (inner) {
      out.push(["key", inner[0]]);
      at += inner[0].length;
      continue;
    }
    for (const [kind, pattern] of PIECES) {
      pattern.lastIndex = at;
      const found = pattern.exec(line);
      if (!found) continue;
      if (kind === "long") {
        const end = line.indexOf(found[0], at + 3);
        const stop = end < 0 ? line.length : end + 3;
        out.push(["text", line.slice(at, stop)]);
        if (end < 0) open = found[0];
        at = stop;
      } else {
        out.push([kind, found[0]]);
        at += found[0].length;
      }
      break;
    }
  }
  return { pieces: out, open };
}

/** A line as nodes. */
export function lineNodes(pieces) {
  return pieces.map(([kind, text]) => {
    if (kind === "plain") return document.createTextNode(text);
    const node = document.createElement("span");
    node.className = `t-${kind}`;
    node.textContent = text;
    return node;
  });
}

/** A whole text to read, with numbered lines. */
export function readOnly(text) {
  const pre = document.createElement("pre");
  pre.className = "toml";
  // Reached with the keyboard, since long lines scroll; and then it needs a name.
  pre.tabIndex = 0;
  pre.setAttribute("role", "region");
  pre.setAttribute("aria-label", "Manifest");
  let open = "";
  for (const line of text.replace(/\n$/, "").split("\n")) {
    const row = document.createElement("span");
    row.className = "line";
    const coloured = colourLine(line, open);
    open = coloured.open;
    row.append(...lineNodes(coloured.pieces), "\n");
    pre.append(row);
  }
  return pre;
}
