// Numbers typed by the user.

/**
 * What was typed in a field: {input, value, error}; `error` is empty if it is a number from `low`
 * to `high`. Nothing is rounded or clipped; an invalid field is marked.
 */
export function typedNumber(input, name, low, high, whole = false) {
  const text = input.value.trim().replace(",", ".");
  const value = text === "" ? NaN : Number(text);
  const good =
    Number.isFinite(value) && value >= low && value <= high && (!whole || Number.isInteger(value));
  if (good) input.removeAttribute("aria-invalid");
  else input.setAttribute("aria-invalid", "true");
  const kind = whole ? "a whole number" : "a number";
  return { input, value, error: good ? "" : `${name} must be ${kind} from ${low} to ${high}` };
}
