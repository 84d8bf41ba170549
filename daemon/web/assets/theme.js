// Dark or light, before the first paint: as chosen here, else as the system prefers, else dark. A
// classic script, because modules run after the first paint.
{
  const light = matchMedia("(prefers-color-scheme: light)");
  const preferred = () => (light.matches ? "light" : "dark");
  const show = (theme) => {
    document.documentElement.dataset.theme = theme;
    dispatchEvent(new Event("theme"));
  };
  show(localStorage.getItem("abbe-theme") ?? preferred());
  light.addEventListener("change", () => { if (!localStorage.getItem("abbe-theme")) show(preferred()); });

  /** Changes to the other one. A choice that the system also prefers is not kept: it follows again. */
  globalThis.changeTheme = () => {
    const theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    if (theme === preferred()) localStorage.removeItem("abbe-theme");
    else localStorage.setItem("abbe-theme", theme);
    show(theme);
  };
}
