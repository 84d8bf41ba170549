/// `abbe calibrate probe`: determines delay and lobing of a touch probe from the touches of a
/// recording. The running daemon makes the recording while the operator touches one place at three
/// feeds (for the delay), or a sphere from all sides at the measuring feed (for the lobing).

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/json_text.hpp"
#include "abbe/calib/probe/observe.hpp"
#include "abbe/config/linear_axes.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "abbe/result/try.hpp"
#include "commands.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;
using protocol::ProbeTrigger;
using protocol::TouchFlag;

struct CalibrateProbeArguments {
  std::string recording;
  std::uint32_t probe = 0;
  double sphere_radius_mm = 0.0;
  double u_sphere_radius_um = 0.0;
  bool json = false;
};

bool usable(const ProbeTrigger& touch) {
  constexpr protocol::TouchFlags kNotUsable =
      TouchFlag::SpeedUnsteady | TouchFlag::NoPosition | TouchFlag::Refused;
  return (touch.touch_flags & kNotUsable) == 0 && has_linear_axes(touch);
}

struct Touches {
  std::vector<calib::probe::RecordedTouch> usable;
  std::string damage;  ///< damage of the recording; empty: none
};

Result<Touches> touches_of(const CalibrateProbeArguments& arguments) {
  const auto recording = RecordingReader::open(arguments.recording);
  ABBE_TRY(recording);
  Touches touches{{}, recording->damage()};
  RecordingSink sink;
  sink.probe_trigger = [&](const ProbeTrigger& t, std::string_view) {
    if (!usable(t) || (arguments.probe != 0 && t.probe != arguments.probe)) return;
    touches.usable.push_back({{t.position[0], t.position[1], t.position[2]},
                              {t.velocity[0], t.velocity[1], t.velocity[2]}});
  };
  (void)recording->read(sink);
  ABBE_TRY(recording->intact());
  return touches;
}

/// Refuses a fit of position against feed whose lack of fit is significant. kMostLackOfFit is the
/// 0.999 quantile of chi-square with one degree of freedom: with three feeds, random scatter
/// exceeds it with a probability of 0.001. A fit with residuals of at most kRepeats_m, the
/// repeatability of the best probes, is accepted in any case.
std::optional<Error> not_on_a_line(const calib::probe::ProbeDelayFit& fit) {
  constexpr double kMostLackOfFit = 10.8;
  constexpr double kRepeats_m = 0.1e-6;
  if (fit.lack_of_fit <= kMostLackOfFit || fit.residual_rms_m <= kRepeats_m) return std::nullopt;
  return Error{
      ErrorCode::DataInsufficient,
      fmt::format(
          "probe delay: the positions are not linear in the feed (lack of fit {:.1f}, residuals "
          "{:.3f} um): more than one place was touched, something moved, or the latch was not yet "
          "synchronised with its clock; record the touches again",
          fit.lack_of_fit, 1e6 * fit.residual_rms_m),
      {}};
}

Error insufficient(const calib::Error& error) {
  return {ErrorCode::DataInsufficient, error.text, {}};
}

int print_delay(const calib::probe::ProbeDelayFit& fit, bool as_json) {
  if (as_json) {
    fmt::print("{}\n", indented_json_text(json{{"delay_us", 1e6 * fit.delay_s},
                                               {"u_delay_us", 1e6 * fit.u_delay_s},
                                               {"jitter_us", 1e6 * fit.u_jitter_s},
                                               {"scatter_um", 1e6 * fit.u_scatter_m},
                                               {"misfit", fit.lack_of_fit},
                                               {"dof", fit.dof},
                                               {"feeds", fit.feeds},
                                               {"touches", fit.touches}}));
    return 0;
  }

  fmt::print(
      "# {} touches at {} feeds; lack of fit {:.2f} (about 1: the positions are linear in the "
      "feed), included in u_delay_us with the {:.0f} degrees of freedom\n",
      fit.touches, fit.feeds, fit.lack_of_fit, fit.dof);
  fmt::print("# add this delay_us to the delay_us of the recording; scatter {:.3f} um\n",
             1e6 * fit.u_scatter_m);
  fmt::print("delay_us = {:.3f}\nu_delay_us = {:.3f}\njitter_us = {:.3f}\n", 1e6 * fit.delay_s,
             1e6 * fit.u_delay_s, 1e6 * fit.u_jitter_s);

  return 0;
}

int print_qualification(const calib::probe::Qualification& q, bool as_json) {
  const auto& terms = q.map.terms_m();
  std::vector<double> terms_um;
  for (const double term : terms) terms_um.push_back(1e6 * term);

  if (as_json) {
    fmt::print("{}\n",
               indented_json_text(json{
                   {"tip_radius_mm", 1e3 * terms[0]},
                   {"u_tip_radius_um", 1e6 * std::sqrt(q.map.covariance_m2()(0, 0))},
                   {"lobing_um", 1e6 * q.lobing_m},
                   {"terms_um", terms_um},
                   {"centre_mm", {1e3 * q.centre_m[0], 1e3 * q.centre_m[1], 1e3 * q.centre_m[2]}},
                   {"sigma_um", 1e6 * q.sigma_m},
                   {"condition", q.condition}}));
    return 0;
  }

  fmt::print("tip_radius_mm = {:.6f}\nlobing_um = {:.3f}\nsigma_um = {:.3f}\n", 1e3 * terms[0],
             1e6 * q.lobing_m, 1e6 * q.sigma_m);
  fmt::print("lobing_terms_um = [{:.4f}]\n", fmt::join(terms_um, ", "));

  return 0;
}

int fit(const CalibrateProbeArguments& arguments,
        const std::vector<calib::probe::RecordedTouch>& touches) {
  if (arguments.sphere_radius_mm > 0.0) {
    const auto q =
        calib::probe::qualify(calib::probe::around_sphere(touches),
                              {.sphere_radius_m = 1e-3 * arguments.sphere_radius_mm,
                               .u_sphere_radius_m = 1e-6 * arguments.u_sphere_radius_um});
    return q ? print_qualification(*q, arguments.json) : report(insufficient(q.error()));
  }
  const auto fit = calib::probe::fit_delay(calib::probe::same_place(touches));
  if (!fit) return report(insufficient(fit.error()));
  if (const auto refused = not_on_a_line(*fit)) return report(*refused);
  return print_delay(*fit, arguments.json);
}

/// The result from a damaged recording is printed, but the command fails: the lost touches could be
/// those that contradict the result.
int calibrate(const CalibrateProbeArguments& arguments) {
  const auto touches = touches_of(arguments);
  if (!touches) return report(touches.error());
  const int exit = fit(arguments, touches->usable);
  if (exit != 0 || touches->damage.empty()) return exit;
  return report({ErrorCode::DataInsufficient,
                 fmt::format("{}: {}", arguments.recording, touches->damage),
                 {}});
}

}  // namespace

void add_calibrate_probe(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<CalibrateProbeArguments>();
  auto* command = parent.add_subcommand(
      "probe",
      "Calibrate a touch probe from recorded touches: its delay, from one place touched at three\n"
      "feeds; or with --sphere-radius-mm its effective tip radius and lobing.\n"
      "If the recording is damaged before its end, the result is printed and the exit code is 1.");
  command->add_option("--recording", arguments->recording, "recording with the touches")
      ->required();
  command->add_option("--probe", arguments->probe, "only touches of this probe; 0: all");
  command->add_option("--sphere-radius-mm", arguments->sphere_radius_mm,
                      "radius of the touched sphere: qualify the probe");
  command->add_option("--u-sphere-radius-um", arguments->u_sphere_radius_um,
                      "standard uncertainty of the radius");
  command->add_flag("--json", arguments->json, "print the result as JSON");
  command->callback([arguments, &exit] { exit = calibrate(*arguments); });
}

}  // namespace abbe::daemon
