  // what a test does with a report's page (page) in its window (view)
  const rest = () => new Promise(done => view.setTimeout(done, 50));
  const key = async (id, ...keys) => {
    page.getElementById("plot-" + id).focus();
    for (const k of keys)
      page.activeElement.dispatchEvent(new view.KeyboardEvent("keydown", {key: k, bubbles: true}));
    await rest();
  };
  const said = id => page.getElementById("readout-" + id).textContent;
  const all = () => [...page.querySelectorAll("#time .readout")].map(e => e.textContent);
  const out = {idle: all()};
  await key("time-Fx", "ArrowRight");
  out.linked = all();
  out.announced = page.getElementById("announced").textContent;
  await key("time-Fx", "+", "+", "Home");
  out.zoomed = all();
  await key("time-Fx", "Escape", "Home");
  out.whole = said("time-tau_x");
  page.getElementById("plot-time-Fx").blur();
  page.querySelectorAll("#controls input[name=effect]")[0].click();
  await rest();
  out.without = said("time-Fx");
  await key("signature-0", "ArrowRight");
  out.signature = said("signature-0");
  await key("frequency-force", "Home");
  out.frequency = said("frequency-force");
  const stops = [...page.querySelectorAll("a[href], button, input, summary, [tabindex='0']")];
  const name = e => e.ariaLabel || e.textContent.trim() || e.labels?.[0]?.textContent;
  out.unnamed = stops.filter(e => !name(e)).map(e => e.outerHTML.slice(0, 80));
  out.plots = stops.filter(e => e.matches(".plot")).length;
  out.tables = page.querySelectorAll("figure details table caption").length;
  out.first = page.getElementById("verdict").getBoundingClientRect().bottom;
  return out;
