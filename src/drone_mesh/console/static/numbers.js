// Numbers typed by the user.

const DECIMAL = /^-?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i; // Number() also takes 0x10

/**
 * What was typed in a field: {input, value, error}; `error` is empty if it is a number from `low`
 * to `high`. Nothing is rounded or clipped; an invalid field is marked.
 */
export function typedNumber(input, name, low, high, whole = false) {
  const text = input.value.trim().replace(",", ".");
  const value = DECIMAL.test(text) ? Number(text) : NaN;
  const good =
    Number.isFinite(value) && value >= low && value <= high && (!whole || Number.isInteger(value));
  if (good) input.removeAttribute("aria-invalid");
  else input.setAttribute("aria-invalid", "true");
  const kind = whole ? "a whole number" : "a number";
  return { input, value, error: good ? "" : `${name} must be ${kind} from ${low} to ${high}` };
}
