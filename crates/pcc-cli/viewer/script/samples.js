// Numbers over time.

// Arrays travel as base64 of little-endian f32.
export function floats(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return new Float32Array(bytes.buffer);
}

// The index of the last sample at or before a time; 0 where there is none.
export function indexAt(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const half = (low + high + 1) >> 1;
    if (times[half] <= time) low = half; else high = half - 1;
  }
  return low;
}
