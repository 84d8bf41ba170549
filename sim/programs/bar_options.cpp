#include "bar_options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <filesystem>

#include "abbe/result/try.hpp"
#include "files.hpp"

namespace abbe::sim {
namespace {

constexpr double kMmPerMinute = 1e-3 / 60.0;  // m/s per mm/min

void add_bar(CLI::App& app, BarOptions& o) {
  app.add_option("--bar-seed", o.bar_seed, "seed of the bar itself (default: --seed)");
  app.add_option("--holes", o.holes, "holes of the bar")->check(CLI::Range(6, 100));
  app.add_option("--pitch-mm", o.pitch_mm, "distance of the holes")->check(CLI::Range(40.0, 200.0));
  app.add_option("--form-um", o.form_um, "form error of the surfaces, standard deviation")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--alpha-um-per-m-K", o.alpha_um_per_m_K,
                 "thermal expansion; with 0 and no uncertainty bar.toml does not state it")
      ->check(CLI::Range(-5.0, 50.0));
  app.add_option("--u-alpha-um-per-m-K", o.u_alpha_um_per_m_K, "its standard uncertainty")
      ->check(CLI::Range(0.0, 10.0));
  app.add_option("--temperature-C", o.temperature_C, "of the bar")->check(CLI::Range(-20.0, 60.0));
  app.add_option("--temperature-spread-K", o.temperature_spread_K,
                 "standard deviation of the temperature from position to position")
      ->check(CLI::Range(0.0, 10.0));
  app.add_option("--u-temperature-K", o.u_temperature_K, "its standard uncertainty")
      ->check(CLI::Range(0.0, 10.0));
  app.add_flag("--stiff", o.stiff, "no sag under gravity; bar.toml then has no [sag]");
}

void add_probing(CLI::App& app, BarOptions& o) {
  app.add_option("--tip-radius-mm", o.tip_radius_mm, "of the stylus")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--probe-um", o.probe_um, "noise of a touch along the normal, k = 1")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--machine-um", o.machine_um, "repeatability of each axis, k = 1")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--lobing-um", o.lobing_um, "amplitude of the three lobes of the probe")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--delay-ms", o.delay_ms, "from contact to trigger: pre-travel = feed x delay")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--feed-mm-per-min", o.feed_mm_per_min, "of a probing move")
      ->check(CLI::Range(1.0, 10000.0));
  app.add_option("--feed-scatter-percent", o.feed_scatter_percent,
                 "standard deviation of the feed from touch to touch")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--clamping-mm", o.clamping_mm, "scatter of the place of the bar, k = 1")
      ->check(CLI::Range(0.0, 2.0));
  app.add_option("--clamping-mrad", o.clamping_mrad, "scatter of its orientation, k = 1")
      ->check(CLI::Range(0.0, 10.0));
  app.add_flag("--exact", o.exact,
               "no noise, and every stated value is true; the files state the same uncertainties");
  app.add_option("--miss", o.missed, "touches left out: \"X1,hole,3,,2\" as in points.csv")
      ->type_name("TOUCH ...");
  app.add_option("--outlier-um", o.outliers, "touches wrong by UM: \"X1,hole,3,,2=50\"")
      ->type_name("TOUCH=UM ...");
  app.add_option("--turned", o.turned, "the bar lies turned in a measurement or position: \"X2=z\"")
      ->type_name("NAME=AXIS ...");
}

Result<void> add_outliers(const BarOptions& o, mfb::ProbingOptions& probing) {
  for (const std::string& text : o.outliers) {
    const auto outlier = split_at_equals(text, "--outlier-um");
    ABBE_TRY(outlier);
    double um = 0.0;
    const char* end = outlier->value.data() + outlier->value.size();
    if (std::from_chars(outlier->value.data(), end, um).ptr != end || outlier->value.empty())
      return usage_error(
          fmt::format("--outlier-um \"{}\": \"{}\" is not a number of um", text, outlier->value));
    probing.wrong_m[outlier->name] = um * kFromMicro;
  }
  return {};
}

Result<void> add_turned(const BarOptions& o, mfb::ProbingOptions& probing) {
  constexpr std::string_view kAxisNames = "xyz";  // letters in the order of mfb::Turned
  for (const std::string& text : o.turned) {
    const auto turned = split_at_equals(text, "--turned");
    ABBE_TRY(turned);
    const std::size_t axis = turned->value.size() == 1 ? kAxisNames.find(turned->value[0]) : 3;
    if (axis >= kAxisNames.size())
      return usage_error(fmt::format("--turned \"{}\": the axis must be x, y or z", text));
    probing.turned[turned->name] = static_cast<mfb::Turned>(axis);
  }
  return {};
}

}  // namespace

void add_bar_options(CLI::App& app, BarOptions& options) {
  app.option_defaults()->always_capture_default();
  app.add_option("-o,--out", options.folder, "folder for the files; is created")
      ->type_name("FOLDER")
      ->required();
  app.add_option("--seed", options.seed, "seed of everything that is random");
  app.add_option("--mean-error-um", options.mean_error_um,
                 "mean |V| of the machine over its travel, without tool")
      ->check(CLI::Range(1e-6, 1e4));
  add_bar(app, options);
  add_probing(app, options);
}

mfb::TrueBar bar_of(const BarOptions& options) {
  return mfb::random_bar(
      mfb::reference_pattern(options.holes, options.pitch_mm * kFromMilli),
      {.form_m = options.form_um * kFromMicro, .seed = options.bar_seed.value_or(options.seed)});
}

Result<mfb::ProbingOptions> probing_of(const BarOptions& o) {
  mfb::ProbingOptions probing;
  probing.seed = o.seed;
  probing.probe = {.tip_radius_m = o.tip_radius_mm * kFromMilli,
                   .noise_m = o.probe_um * kFromMicro,
                   .lobing_m = o.lobing_um * kFromMicro,
                   .delay_s = o.delay_ms * kFromMilli,
                   .feed_m_per_s = o.feed_mm_per_min * kMmPerMinute,
                   .feed_scatter = 0.01 * o.feed_scatter_percent};
  probing.machine_noise_m = o.machine_um * kFromMicro;
  probing.clamping_m = o.clamping_mm * kFromMilli;
  probing.clamping_rad = o.clamping_mrad * kFromMilli;
  probing.temperature = {.stated_C = o.temperature_C,
                         .spread_K = o.temperature_spread_K,
                         .u_K = o.u_temperature_K,
                         .alpha_per_K = o.alpha_um_per_m_K * kFromMicro,
                         .u_alpha_per_K = o.u_alpha_um_per_m_K * kFromMicro};
  if (!o.stiff)
    probing.sag = mfb::reference_sag(mfb::reference_pattern(o.holes, o.pitch_mm * kFromMilli));
  probing.missed.insert(o.missed.begin(), o.missed.end());

  return add_outliers(o, probing).and_then([&] { return add_turned(o, probing); }).map([&] {
    return probing;
  });
}

mfb::ProbingOptions simulated(const mfb::ProbingOptions& stated, const BarOptions& options) {
  mfb::ProbingOptions applied = stated;
  if (!options.exact) return applied;
  applied.probe.noise_m = applied.probe.feed_scatter = applied.machine_noise_m = 0.0;
  applied.temperature.u_K = applied.temperature.u_alpha_per_K = 0.0;
  applied.shape_scatter_m = 0.0;
  return applied;
}

void set_properties(mfb::StatedBar& bar, const mfb::ProbingOptions& stated) {
  bar.alpha_per_K = stated.temperature.alpha_per_K;
  bar.u_alpha_per_K = stated.temperature.u_alpha_per_K;
  bar.sag = stated.sag;
}

Result<NameAndValue> split_at_equals(const std::string& text, std::string_view option) {
  const std::size_t at = text.rfind('=');
  if (at == std::string::npos)
    return usage_error(fmt::format("{} \"{}\": needs NAME=VALUE", option, text));
  return NameAndValue{text.substr(0, at), text.substr(at + 1)};
}

Result<void> write_folder(const std::string& folder, const std::vector<NamedText>& files) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) return io_error(folder + ": cannot be created: " + failed.message());
  for (const NamedText& file : files) {
    auto written = write_file((std::filesystem::path(folder) / file.name).string(), file.text);
    if (!written) return written;
  }
  return {};
}

Error as_usage(Error error) {
  if (error.code == ErrorCode::BadInput) error.code = ErrorCode::Usage;
  return error;
}

}  // namespace abbe::sim
