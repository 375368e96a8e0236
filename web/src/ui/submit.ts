// Submission of a form by the page itself.

/** Return a handler that acts in place of the browser, which would load a page. */
export const submit = (act: () => void) => (event: Event) => {
  event.preventDefault();
  act();
};
