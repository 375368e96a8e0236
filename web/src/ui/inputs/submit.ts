// Submission of a form by the page itself.

/** Return a form's `onSubmit` that calls `act`; the browser then does not submit it, which would load a page. */
export const submit = (act: () => void) => (event: Event) => {
  event.preventDefault();
  act();
};
