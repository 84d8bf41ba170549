#include "abbe/methods/mfb/acquisition.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "usable_touch.hpp"

namespace abbe::daemon {

namespace mfb = calib::mfb;

namespace {

using protocol::HostTime;

/// Takes the touches of earlier sessions. It is an Error if the guide does not take all of them,
/// because it took the same touches before.
Result<void> take_earlier(mfb::TouchGuide& guide, const std::vector<calib::Vector3>& earlier_m) {
  for (std::size_t i = 0; i < earlier_m.size(); ++i) {
    const mfb::GuidedTouch taken = guide.take(earlier_m[i]);
    if (taken.fate != mfb::TouchFate::Taken)
      return fail(ErrorCode::BadInput,
                  fmt::format("touch {} of the earlier recording does not belong to bar and plan: "
                              "{}",
                              i + 1, taken.notes.empty() ? "all were made" : taken.notes.back()));
  }
  return {};
}

}  // namespace

Result<MfbAcquisition> MfbAcquisition::create(const MfbRequest& request,
                                              MfbAcquisitionOptions options) {
  ABBE_TRY(options.machine);
  auto bar = parse_bar_toml(request.bar.text, request.bar.name);
  ABBE_TRY(bar);
  auto plan = parse_bar_plan_toml(request.plan.text, request.plan.name, bar->bar);
  ABBE_TRY(plan);
  auto guide = mfb::TouchGuide::create(bar->bar, std::move(plan->plan), *options.machine);
  if (!guide)
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", request.plan.name, guide.error().text));
  ABBE_TRY(take_earlier(*guide, request.earlier_m));
  return MfbAcquisition{
      std::move(bar->bar), {bar->source, plan->source}, *std::move(guide), std::move(options)};
}

MfbAcquisition::MfbAcquisition(mfb::Bar bar, std::vector<InputFile> sources, mfb::TouchGuide guide,
                               MfbAcquisitionOptions options)
    : bar_(std::move(bar)),
      sources_(std::move(sources)),
      guide_(std::move(guide)),
      temperature_K_(guide_.plan().measurements.size()),
      options_(std::move(options)),
      intake_(options_.touches),
      has_earlier_(guide_.taken() > 0) {
  follow_guide();
}

double MfbAcquisition::progress() const {
  return phase_ == Phase::Complete
             ? 1.0
             : static_cast<double>(guide_.taken()) / static_cast<double>(guide_.planned());
}

std::optional<RequestedTouch> MfbAcquisition::next() const {
  if (phase_ == Phase::Complete || phase_ == Phase::Failed) return std::nullopt;
  const mfb::NextTouch next = guide_.next();
  return RequestedTouch{.measurement = guide_.plan().measurements[next.measurement].name,
                        .place = next.measurement,
                        .on = mfb::feature_name(next.target),
                        .touched = next.touched,
                        .points = next.planned};
}

void MfbAcquisition::take(const protocol::Snapshot& snapshot) {
  if (phase_ == Phase::Complete || phase_ == Phase::Failed || !intake_.is_of_run(snapshot)) return;
  if (auto lost = intake_.lost_zero(snapshot); phase_ == Phase::Running && !lost.empty())
    return end(std::move(lost));
  if (const auto fault = touch_fault(snapshot); !fault.empty()) return refuse(snapshot, fault);
  const auto temperature_K = temperature_at(snapshot);
  if (!temperature_K)
    return refuse(snapshot, fmt::format("the temperature \"{}\" of the bar was not known",
                                        options_.bar_sensor));

  intake_.usable(snapshot);
  const calib::Vector3 reading_m{snapshot.position[0], snapshot.position[1], snapshot.position[2]};
  const mfb::GuidedTouch taken = take_at(reading_m, *temperature_K);
  for (const std::string& text : taken.notes) intake_.note(snapshot, text);
  if (taken.fate == mfb::TouchFate::Taken) phase_ = Phase::Running;
  follow_guide();
}

std::optional<double> MfbAcquisition::temperature_at(const protocol::Snapshot& touch) const {
  if (!options_.bar) return 0.0;
  const double t_K =
      touch.has_environment ? touch.environment.temperature_K[*options_.bar->sensor] : std::nan("");
  return std::isfinite(t_K) ? std::optional(t_K) : std::nullopt;
}

/// Takes a touch and adds the temperature to the pass that contains the touch. If the guide
/// discards a pass, its temperatures are discarded, too.
mfb::GuidedTouch MfbAcquisition::take_at(const calib::Vector3& reading_m, double temperature_K) {
  std::vector<std::size_t> before;
  for (const mfb::PassTouches& pass : guide_.passes()) before.push_back(pass.size());
  mfb::GuidedTouch taken = guide_.take(reading_m);
  for (std::size_t pass = 0; pass < before.size(); ++pass) {
    const std::size_t now = guide_.passes()[pass].size();
    if (now < before[pass]) temperature_K_[pass].clear();
    if (options_.bar && now > 0 && now != before[pass] && taken.fate == mfb::TouchFate::Taken)
      temperature_K_[pass].push_back(temperature_K);
  }
  return taken;
}

/// Sets phase and instruction after a touch.
void MfbAcquisition::follow_guide() {
  const auto& plan = guide_.plan();
  if (const auto& failure = guide_.failure()) {
    end(failure->text);
  } else if (guide_.complete()) {
    phase_ = Phase::Complete;
    reason_ =
        fmt::format("{} touches in {} measurements", guide_.taken(), plan.measurements.size());
  } else {
    const mfb::NextTouch next = guide_.next();
    const mfb::Measurement& m = plan.measurements[next.measurement];
    reason_ = fmt::format("{}, position {} ({} of {}), {}: touch {}, {} points", m.name, m.position,
                          next.measurement + 1, plan.measurements.size(),
                          m.direction == mfb::PassDirection::Forward ? "forward" : "backward",
                          mfb::feature_name(next.target), next.planned);
  }
}

void MfbAcquisition::refuse(const protocol::Snapshot& touch, std::string_view fault) {
  auto too_many = intake_.refuse(touch, fault, guide_.next_text());
  if (!too_many.empty() && phase_ == Phase::WaitingAtStart) end(std::move(too_many));
}

void MfbAcquisition::end(std::string reason) {
  phase_ = Phase::Failed;
  reason_ = std::move(reason);
}

void MfbAcquisition::tick(HostTime now) {
  const std::string pause = intake_.pause(now);
  if (phase_ == Phase::Complete || phase_ == Phase::Failed || pause.empty()) return;
  end(fmt::format("{}; {}; abbe calibrate mfb --continue uses the touches of the recording", pause,
                  reason_));
}

std::vector<calib::Vector3> MfbAcquisition::readings_m() const {
  std::vector<calib::Vector3> all;
  for (const mfb::PassTouches& pass : guide_.passes())
    for (const mfb::Touch& touch : pass) all.push_back(touch.reading_m);
  return all;
}

mfb::Plan MfbAcquisition::plan_as_measured() const {
  mfb::Plan plan = guide_.plan();
  if (!options_.bar) return plan;
  double u_drift_K = 0.0, u_common_K = options_.bar->u_temperature_K;
  for (std::size_t pass = 0; pass < plan.measurements.size(); ++pass) {
    const auto& values_K = temperature_K_[pass];
    if (values_K.empty()) {
      if (!guide_.passes()[pass].empty())
        u_common_K = std::max(u_common_K, plan.noise.common_temperature_K());
      continue;
    }
    const auto [low, high] = std::ranges::minmax_element(values_K);
    plan.measurements[pass].temperature_K = std::accumulate(values_K.begin(), values_K.end(), 0.0) /
                                            static_cast<double>(values_K.size());
    // The distribution is rectangular over the range of the values ([GUM] 4.3.7).
    u_drift_K = std::max(u_drift_K, (*high - *low) / (2.0 * std::numbers::sqrt3));
  }
  plan.noise.u_temperature_K = std::hypot(plan.noise.u_temperature_K, u_drift_K);
  plan.noise.u_common_temperature_K = u_common_K;
  return plan;
}

MfbRun MfbAcquisition::release() {
  return {std::move(bar_), plan_as_measured(), guide_.passes(), std::move(sources_),
          has_earlier_ ? std::nullopt : intake_.observed()};
}

}  // namespace abbe::daemon
