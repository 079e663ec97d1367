// The only module that talks to the server: JSON, binary, uploads with progress and
// server-sent events, each with the token of this browser tab where there is one.
//
// Paths are relative to /api/v1 and start with "/": `api.json("/studies/quick@0")`.
// Every failure is an ApiError that carries the server's problem document.

const BASE = "/api/v1";
const TOKEN_KEY = "cullmark.token";
const FIRST_RETRY_MS = 1000;
const LAST_RETRY_MS = 30000;
// A server that is alive sends a comment every so often; silence this long means it is gone.
const SILENCE_MS = 90000;

/** A failure with what the server said about it (RFC 9457). Status 0: no answer came. */
export class ApiError extends Error {
  constructor(problem) {
    super(problem.detail || problem.title || "The request failed");
    this.name = "ApiError";
    this.problem = problem;
    this.status = problem.status ?? 0;
    this.title = problem.title || "The request failed";
    this.detail = problem.detail || "";
    this.help = problem.help || "";
    this.errors = problem.errors || [];
  }
}

/** True for the error that an aborted request ends with: nothing to show to anybody. */
export const isAbort = (error) => error?.name === "AbortError";

/** A study's name for a path; `@` stays readable. */
export const segment = (text) => encodeURIComponent(text).replace(/%40/g, "@");

let askForToken = null;
let asking = null;

/** Registers who asks the user for a token on 401: `async (problem) => true` to try again. */
export function onUnauthorized(ask) {
  askForToken = ask;
}

// sessionStorage only: a token must not outlive the tab. Storage may be forbidden altogether.
let heldToken = "";
/** The token of this tab, or "". */
export function token() {
  try {
    return sessionStorage.getItem(TOKEN_KEY) || heldToken;
  } catch {
    return heldToken;
  }
}
export function setToken(value) {
  heldToken = value;
  try {
    if (value) sessionStorage.setItem(TOKEN_KEY, value);
    else sessionStorage.removeItem(TOKEN_KEY);
  } catch {
    // Kept in memory until the page is left.
  }
}

/** The address of an API path, with query parameters; empty ones are left out. */
export function url(path, query = {}) {
  const pairs = Object.entries(query).filter(([, v]) => v !== undefined && v !== null && v !== "");
  const text = pairs.map(([k, v]) => `${encodeURIComponent(k)}=${encodeURIComponent(v)}`).join("&");
  return BASE + path + (text ? (path.includes("?") ? "&" : "?") + text : "");
}

/** Headers with the token; what an option names comes on top. */
function headersOf(options) {
  const headers = new Headers(options.headers || {});
  if (token()) headers.set("Authorization", `Bearer ${token()}`);
  if (options.accept) headers.set("Accept", options.accept);
  return headers;
}

/** The problem document of an answer, or one made up for it when a proxy answered instead. */
async function problemOf(response) {
  const fallback = {
    status: response.status,
    title: `The server answered ${response.status} ${response.statusText}`.trim(),
  };
  try {
    const text = await response.text();
    return { ...fallback, ...JSON.parse(text) };
  } catch {
    return fallback;
  }
}

const unreachable = (error) =>
  new ApiError({
    status: 0,
    title: "The server does not answer",
    detail: String(error?.message || error),
    help: "Is `cullmark serve` running, and can this machine reach it?",
  });

/** Asks once, however many requests were refused at the same time. */
function unauthorized(problem) {
  asking ??= Promise.resolve(askForToken(problem)).finally(() => {
    asking = null;
  });
  return asking;
}

/** One request, asked again after a token was given; everything but 2xx is an ApiError. */
async function request(path, options = {}) {
  for (;;) {
    const sent = token();
    let response;
    try {
      response = await fetch(url(path, options.query), {
        method: options.method || "GET",
        headers: headersOf(options),
        body: options.body,
        signal: options.signal,
      });
    } catch (error) {
      if (isAbort(error)) throw error;
      throw unreachable(error);
    }
    if (response.ok) return response;
    const problem = await problemOf(response);
    if (response.status === 401 && askForToken && !options.quiet) {
      // Another request may have brought a token while this one was under way.
      if (token() !== sent || (await unauthorized(problem))) continue;
    }
    throw new ApiError(problem);
  }
}

/** Requests `method path` with a JSON body; null for an answer without one. */
async function send(method, path, body, options = {}) {
  const json = body !== undefined && body !== null;
  const response = await request(path, {
    accept: "application/json",
    ...options,
    method,
    headers: json ? { "Content-Type": "application/json" } : {},
    body: json ? JSON.stringify(body) : undefined,
  });
  const text = await response.text();
  return text ? JSON.parse(text) : null;
}

/** Saves what the server answers as a file; through a blob, so that the token travels. */
async function download(path, name, options = {}) {
  const blob = await (await request(path, options)).blob();
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

/** Sends a file as the body. XMLHttpRequest, because fetch tells nothing of how far it is. */
function upload(path, file, onProgress = () => {}, { query, signal } = {}) {
  const once = () =>
    new Promise((resolve, reject) => {
      const xhr = new XMLHttpRequest();
      xhr.open("POST", url(path, query));
      xhr.setRequestHeader("Content-Type", "application/octet-stream");
      if (token()) xhr.setRequestHeader("Authorization", `Bearer ${token()}`);
      xhr.upload.onprogress = (e) => onProgress(e.loaded, e.lengthComputable ? e.total : file.size);
      xhr.onabort = () => reject(new DOMException("aborted", "AbortError"));
      xhr.onerror = () => reject(unreachable("the connection broke while sending"));
      xhr.onload = () => {
        let body = null;
        try {
          body = JSON.parse(xhr.responseText);
        } catch {
          // A proxy's error page is no problem document.
        }
        if (xhr.status >= 200 && xhr.status < 300) return resolve(body);
        reject(new ApiError({ status: xhr.status, title: `The server answered ${xhr.status}`, ...body }));
      };
      signal?.addEventListener("abort", () => xhr.abort(), { once: true });
      xhr.send(file);
    });
  return once().catch(async (error) => {
    if (error.status === 401 && askForToken && (await unauthorized(error.problem))) return once();
    throw error;
  });
}

/**
 * Reads server-sent events through fetch (EventSource cannot send a token) and connects
 * again with growing pauses. `onEvent({event, data})` gets parsed JSON; `end` and a
 * refusal (4xx) end it. `onState("live" | "lost" | "ended", error?)` tells how it stands.
 */
function stream(path, { onEvent, onState = () => {}, signal, query } = {}) {
  const ours = new AbortController();
  const stop = () => ours.abort();
  signal?.addEventListener("abort", stop, { once: true });
  if (signal?.aborted) stop();
  let lastId = "";
  let pause = FIRST_RETRY_MS;

  const once = async () => {
    const connection = new AbortController();
    const close = () => connection.abort();
    ours.signal.addEventListener("abort", close, { once: true });
    let silence = setTimeout(close, SILENCE_MS);
    try {
      const headers = lastId ? { "Last-Event-ID": lastId } : {};
      const response = await request(path, {
        query,
        headers,
        accept: "text/event-stream",
        signal: connection.signal,
      });
      onState("live");
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      const parser = eventParser();
      for (;;) {
        const { done, value } = await reader.read();
        if (done) return false;
        clearTimeout(silence);
        silence = setTimeout(close, SILENCE_MS);
        for (const event of parser(value)) {
          pause = event.retry || FIRST_RETRY_MS;
          if (event.id) lastId = event.id;
          if (event.data === undefined) continue;
          onEvent({ event: event.event, data: event.data });
          if (event.event === "end") return true;
        }
      }
    } finally {
      clearTimeout(silence);
      ours.signal.removeEventListener("abort", close);
    }
  };

  const loop = async () => {
    while (!ours.signal.aborted) {
      try {
        if (await once()) return onState("ended");
        onState("lost");
      } catch (error) {
        if (ours.signal.aborted) return;
        const refused = error.status >= 400 && error.status < 500 && error.status !== 429;
        onState(refused ? "ended" : "lost", error);
        if (refused) return;
      }
      // Apart from each other, so that many tabs do not come back in the same instant.
      await new Promise((resolve) => setTimeout(resolve, pause * (0.75 + Math.random() / 2)));
      pause = Math.min(pause * 2, LAST_RETRY_MS);
    }
  };
  loop();
  return {
    close: stop,
    get closed() {
      return ours.signal.aborted;
    },
  };
}

/** Events out of pieces of text; a piece may end in the middle of anything. */
function eventParser() {
  let rest = "";
  let event = {};
  let lines = [];
  return (piece) => {
    rest += piece;
    const complete = [];
    const parts = rest.split(/\r\n|\n|\r(?!$)/);
    rest = parts.pop();
    for (const line of parts) {
      if (line === "") {
        if (lines.length) complete.push({ event: "message", ...event, data: parsed(lines.join("\n")) });
        else if (event.retry) complete.push(event);
        event = {};
        lines = [];
        continue;
      }
      const [, field, value] = /^([^:]*):? ?(.*)$/.exec(line);
      if (field === "data") lines.push(value);
      else if (field === "event") event.event = value;
      else if (field === "id") event.id = value;
      else if (field === "retry" && Number(value) > 0) event.retry = Number(value);
    }
    return complete;
  };
}

/** JSON where it is some, else the text itself. */
function parsed(text) {
  try {
    return JSON.parse(text);
  } catch {
    return text;
  }
}

/** The body of an answer. It may break off after the headers, which is no other failure than no answer. */
async function read(response, how) {
  try {
    return await response[how]();
  } catch (error) {
    throw error instanceof TypeError ? unreachable(error) : error;
  }
}

export const api = {
  json: async (path, options = {}) =>
    read(await request(path, { accept: "application/json", ...options }), "json"),
  text: async (path, options) => read(await request(path, options), "text"),
  binary: async (path, options) => read(await request(path, options), "arrayBuffer"),
  blob: async (path, options) => read(await request(path, options), "blob"),
  post: (path, body, options) => send("POST", path, body, options),
  patch: (path, body, options) => send("PATCH", path, body, options),
  del: (path, options) => send("DELETE", path, undefined, options),
  upload,
  stream,
  download,
  url,
};
