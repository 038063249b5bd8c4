// Entry point of the page.
import { render } from "preact";
import { App } from "./app";
import { keepScroll } from "./scroll";
import "./style/tokens.css";
import "./style/layout.css";
import "./style/parts.css";
import "./style/views.css";

keepScroll();
const root = document.getElementById("app");
if (root !== null) render(<App />, root);
