// The 3-D chunk: what views load when they first draw in 3-D.
export { picture } from "./picture";
export { Stage } from "./stage";
