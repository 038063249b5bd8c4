// Words of the page for what the API names in a word of its own.

const WORDS: Record<string, string> = {
  surface: "surface matching",
  sva: "pairs of touches",
  sva_literal: "pairs of touches (as published)",
  appearance: "touch images alone",
  appearance_literal: "touch images alone (as published)",
  geometric: "contact map",
  geometric_histogram: "contact map, histogram filter",
  geometric_particles: "contact map, particle filter",
};

/** The names of the methods in the API. */
export const METHODS = Object.keys(WORDS);

/** A method in words. */
export function methodWords(method: string): string {
  return WORDS[method] ?? method.replaceAll("_", " ");
}

const DESCRIPTORS: Record<string, string> = {
  vectorize: "pressures as they are",
  sift: "histograms of gradients",
  mr8: "oriented filters",
  moment_normalized: "turned to their principal axes",
  polar_fourier: "rings in the frequency domain",
  polar_fourier_rw: "rings in the frequency domain, weighted by radius",
  polar_fourier_ni: "rings in the frequency domain, rings alone",
  polar_fourier_signed: "rings in the frequency domain, mirror images told apart",
  mnti: "turned to their principal axes, whatever their position",
  polar_spectrum: "spatial frequencies, whatever position and direction",
  steerable: "derivatives at the centre",
  schmid: "round filters",
};

/** How touch images are compared, in words, with the API's name. */
export function descriptorWords(descriptor: string): string {
  const words = DESCRIPTORS[descriptor];
  return words === undefined ? descriptor : `${words} (${descriptor})`;
}
