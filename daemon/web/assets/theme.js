// Dark or light, before the first paint: as chosen here, else as the system prefers, else dark. A
// classic script, because modules run after the first paint.
{
  const kChosen = "abbe-theme-chosen";
  // A browser may refuse its store; a choice then holds until the page is closed.
  const inStore = (use) => {
    try {
      return use(localStorage);
    } catch {
      return null;
    }
  };
  inStore((store) => store.removeItem("abbe-theme"));  // of an earlier page, which kept what was not chosen
  let chosen = inStore((store) => store.getItem(kChosen));
  if (chosen !== "dark" && chosen !== "light") chosen = null;

  const light = matchMedia("(prefers-color-scheme: light)");
  const preferred = () => (light.matches ? "light" : "dark");
  const show = () => {
    document.documentElement.dataset.theme = chosen ?? preferred();
    dispatchEvent(new Event("theme"));
  };
  show();
  light.addEventListener("change", () => { if (!chosen) show(); });

  /** Changes to the other one. A choice that the system also prefers is not kept: it follows again. */
  globalThis.changeTheme = () => {
    const other = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    chosen = other === preferred() ? null : other;
    inStore((store) => (chosen ? store.setItem(kChosen, chosen) : store.removeItem(kChosen)));
    show();
  };
}
