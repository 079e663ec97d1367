// The state of a view (tab, filter, sort, metric) lives in the query of the address,
// so that a view can be shared, reloaded and walked back to.

/** Parameters of the address as a plain object. */
export function readQuery() {
  return Object.fromEntries(new URLSearchParams(location.search));
}

/**
 * Lays `changes` over the query; null, undefined and "" take a key out.
 * Replaces the entry of the history unless `push` is set: typing is not navigation.
 */
export function writeQuery(changes, { push = false } = {}) {
  const query = new URLSearchParams(location.search);
  for (const [key, value] of Object.entries(changes)) {
    if (value === null || value === undefined || value === "" || value === false) query.delete(key);
    else query.set(key, value === true ? "1" : value);
  }
  // Kept readable: commas, @ and = in values need no escapes in a query.
  const text = query.toString().replace(/%2C/g, ",").replace(/%40/g, "@").replace(/%3A/g, ":");
  const address = location.pathname + (text ? `?${text}` : "") + location.hash;
  if (address === location.pathname + location.search + location.hash) return;
  if (push) history.pushState(null, "", address);
  else history.replaceState(null, "", address);
}

/** A link's address with a query; empty values are left out. */
export function withQuery(path, query) {
  const pairs = Object.entries(query).filter(([, v]) => v !== null && v !== undefined && v !== "");
  const text = new URLSearchParams(pairs).toString().replace(/%40/g, "@");
  return text ? `${path}?${text}` : path;
}
