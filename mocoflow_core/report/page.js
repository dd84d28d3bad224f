// Each camera shows one moment at a time; its slider chooses which.
for (const camera of document.querySelectorAll(".camera")) {
  const slider = camera.querySelector("input");
  const moments = camera.querySelectorAll(".pictures");
  const label = camera.querySelector(".moment");
  const show = () => {
    moments.forEach((moment, position) => { moment.hidden = position !== Number(slider.value); });
    label.textContent = moments[slider.value].dataset.moment;
  };
  slider.addEventListener("input", show);
  show();
}

// The controls would cover the person, so they wait for the pointer.
for (const video of document.querySelectorAll("video")) {
  video.addEventListener("pointerenter", () => { video.controls = true; });
  video.addEventListener("pointerleave", () => { video.controls = false; });
}
