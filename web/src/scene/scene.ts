// The 3-D chunk: what views load when they first draw in 3-D.
export { Stage } from "./stage";
