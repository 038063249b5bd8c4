// What the page's modules ask of a browser while they load, as far as the unit tests need it.
globalThis.sessionStorage = { getItem: () => null, setItem() {}, removeItem() {} };
globalThis.matchMedia = () => ({ matches: false, addEventListener() {} });
globalThis.document = { hidden: false };
globalThis.location = { hash: "" };
globalThis.history = { state: null, replaceState: (_state, _title, address) => (location.hash = address) };
const listeners = new EventTarget();
globalThis.addEventListener = listeners.addEventListener.bind(listeners);
globalThis.dispatchEvent = listeners.dispatchEvent.bind(listeners);
