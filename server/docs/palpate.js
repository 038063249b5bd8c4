// The API's documentation: Swagger UI in the dashboard's colours, and with names for what a
// screen reader meets.
const dark = matchMedia("(prefers-color-scheme: dark)");
const follow = () => document.documentElement.classList.toggle("dark-mode", dark.matches);
dark.addEventListener("change", follow);
follow();

/** The page has its own head, this server only, and no links inside of buttons. */
const ours = ({ React }) => ({
  wrapComponents: {
    InfoContainer: () => () => null,
    ServersContainer: () => () => null,
    DeepLink: () => ({ text }) => React.createElement("span", null, text),
  },
});

const NAMES = [
  [".body-param__text", "Request body"],
  [".body-param-content-type select, .content-type", "Content type"],
  [".copy-to-clipboard button", "Copy"],
  [".parameters input, .parameters select", "Value"],
];

/** Names inputs and buttons, and lets the keyboard scroll what is longer than its box. */
function complete() {
  for (const [selector, name] of NAMES) {
    for (const element of document.querySelectorAll(selector)) {
      const row = element.closest("tr")?.dataset.paramName;
      element.ariaLabel ??= row ?? name;
    }
  }
  for (const box of document.querySelectorAll("pre.example, pre.microlight, .highlight-code > pre")) box.tabIndex = 0;
}
new MutationObserver(complete).observe(document.getElementById("operations"), { childList: true, subtree: true });

SwaggerUIBundle({
  dom_id: "#operations",
  url: "/openapi.json",
  layout: "BaseLayout",
  plugins: [ours],
  deepLinking: true,
  tryItOutEnabled: true,
  displayRequestDuration: true,
  defaultModelsExpandDepth: -1,
  validatorUrl: null,
  syntaxHighlight: false,
});
