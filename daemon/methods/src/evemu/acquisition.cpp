#include "abbe/methods/evemu/acquisition.hpp"

#include <fmt/format.h>

#include <array>
#include <memory>
#include <span>
#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/config/calib_error.hpp"
#include "usable_touch.hpp"

namespace abbe::daemon {
namespace {

namespace evemu = calib::evemu;
using protocol::HostTime;

/// The text of a fault if the reading is outside the travel by more than kTolerance_m; else empty.
std::string outside(const calib::Vector3& reading_m,
                    const std::optional<calib::MachineNodes>& travel) {
  constexpr double kTolerance_m = 1e-3;
  if (!travel) return {};
  const auto found = calib::outside_travel(std::span(&reading_m, 1), *travel, kTolerance_m);
  if (found.empty()) return {};
  const std::size_t axis = found.front().axis;
  const auto& nodes_m = (*travel)[axis].nodes_m;
  return fmt::format(
      "{0} {1:.3f} mm is outside its travel, {2:g} to {3:g} mm: check [axes.{0}] and the zero of "
      "the axis",
      "XYZ"[axis], kMmPerM * reading_m[static_cast<Eigen::Index>(axis)], kMmPerM * nodes_m.front(),
      kMmPerM * nodes_m.back());
}

std::optional<std::array<double, 3>> xyz(const std::optional<calib::Vector3>& v) {
  if (!v) return std::nullopt;
  return std::array{v->x(), v->y(), v->z()};
}

std::shared_ptr<const std::vector<FeatureToTouch>> features_of(const evemu::TouchGuide& guide) {
  std::vector<FeatureToTouch> features;
  for (const evemu::FeatureProgress& f : guide.features())
    features.push_back({.on = evemu::name(f.on),
                        .touched = f.touched,
                        .points = f.points,
                        .at_m = xyz(f.at_m),
                        .normal = xyz(f.normal)});
  return std::make_shared<const std::vector<FeatureToTouch>>(std::move(features));
}

}  // namespace

Result<EvemuAcquisition> EvemuAcquisition::create(EvemuRequest request,
                                                  EvemuAcquisitionOptions options) {
  auto guide = evemu::TouchGuide::create(request.calibrator, request.plan);
  if (!guide) return tl::unexpected(error_of(guide.error()));
  return EvemuAcquisition{std::move(request), std::move(*guide), std::move(options)};
}

EvemuAcquisition::EvemuAcquisition(EvemuRequest request, evemu::TouchGuide guide,
                                   EvemuAcquisitionOptions options)
    : request_(std::move(request)),
      guide_(std::move(guide)),
      thermometer_(options.artefact),
      options_(std::move(options)),
      intake_(options_.touches) {
  follow_guide();
}

double EvemuAcquisition::progress() const noexcept {
  return phase_ == Phase::Complete
             ? 1.0
             : static_cast<double>(guide_.taken()) / static_cast<double>(guide_.planned());
}

std::optional<RequestedTouch> EvemuAcquisition::next() const {
  if (phase_ == Phase::Complete || phase_ == Phase::Failed) return std::nullopt;
  const evemu::NextTouch next = guide_.next();
  return RequestedTouch{.position = next.position,
                        .measurement = {},
                        .place = next.place,
                        .on = evemu::name(next.on),
                        .touched = next.touched,
                        .points = next.points,
                        .features = features_};
}

void EvemuAcquisition::take(const protocol::Snapshot& snapshot) {
  if (phase_ == Phase::Complete || phase_ == Phase::Failed || !intake_.is_of_run(snapshot)) return;
  if (auto lost = intake_.lost_zero(snapshot); phase_ == Phase::Running && !lost.empty())
    return end(std::move(lost));

  if (const auto fault = touch_fault(snapshot); !fault.empty()) return refuse(snapshot, fault);
  const calib::Vector3 reading_m{snapshot.position[0], snapshot.position[1], snapshot.position[2]};
  if (const auto fault = outside(reading_m, options_.travel); !fault.empty())
    return refuse(snapshot, fault);

  if (!thermometer_.take(snapshot)) {
    return refuse(snapshot, fmt::format("the temperature \"{}\" of the array was not known",
                                        options_.artefact_sensor));
  }

  intake_.usable(snapshot);
  for (const std::string& text : guide_.take(reading_m).notes) intake_.note(snapshot, text);
  if (guide_.taken() > 0 && phase_ == Phase::WaitingAtStart) phase_ = Phase::Running;

  if (const auto& failure = guide_.failure()) {
    end(failure->text);
  } else if (guide_.complete()) {
    phase_ = Phase::Complete;
    reason_ =
        fmt::format("{} touches at {} positions", guide_.taken(), request_.plan.positions.size());
  } else {
    follow_guide();
  }
}

void EvemuAcquisition::refuse(const protocol::Snapshot& touch, std::string_view fault) {
  auto too_many = intake_.refuse(touch, fault, evemu::name(guide_.next().on));
  if (!too_many.empty() && phase_ == Phase::WaitingAtStart) end(std::move(too_many));
}

void EvemuAcquisition::end(std::string reason) {
  phase_ = Phase::Failed;
  reason_ = std::move(reason);
}

void EvemuAcquisition::follow_guide() {
  features_ = features_of(guide_);
  const auto next = guide_.next();
  reason_ =
      fmt::format("position {} ({} of {}): touch {}, {} points", next.position, next.place + 1,
                  request_.plan.positions.size(), evemu::name(next.on), next.points);
}

void EvemuAcquisition::tick(HostTime now) {
  const std::string pause = intake_.pause(now);
  if (phase_ == Phase::Complete || phase_ == Phase::Failed || pause.empty()) return;
  end(fmt::format("{}; {}", pause, reason_));
}

EvemuRun EvemuAcquisition::release() {
  return {std::move(request_), guide_.touches(), thermometer_.over_the_run(), intake_.observed()};
}

}  // namespace abbe::daemon
