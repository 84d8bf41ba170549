#include "abbe/methods/evemu/acquisition.hpp"

#include <fmt/format.h>

#include <span>
#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/calib/axis_mistakes.hpp"
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
      options_(std::move(options)) {
  report_next_step();
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
                        .points = next.points};
}

void EvemuAcquisition::take(const protocol::Snapshot& snapshot) {
  if (!snapshot.has_trigger || snapshot.head.time < from_) return;
  if (phase_ == Phase::Complete || phase_ == Phase::Failed) return;
  last_touch_ = snapshot.head.time;

  if (phase_ == Phase::Running && options_.zero_is_lost_by_restart &&
      has(snapshot.head.flags, protocol::SampleFlag::Restarted)) {
    phase_ = Phase::Failed;
    reason_ = fmt::format(
        "{} touch {}: its device restarted, and the axes have another zero; calibrate again",
        options_.device, snapshot.trigger.touch);
    return;
  }

  if (const auto fault = touch_fault(snapshot); !fault.empty()) return refuse(snapshot, fault);
  const calib::Vector3 reading_m{snapshot.position[0], snapshot.position[1], snapshot.position[2]};
  if (const auto fault = outside(reading_m, options_.travel); !fault.empty())
    return refuse(snapshot, fault);

  if (!thermometer_.take(snapshot)) {
    return refuse(snapshot, fmt::format("the temperature \"{}\" of the array was not known",
                                        options_.artefact_sensor));
  }

  refused_in_a_row_ = 0;
  for (const std::string& text : guide_.take(reading_m).notes) note(snapshot, text);
  if (guide_.taken() > 0 && phase_ == Phase::WaitingAtStart) phase_ = Phase::Running;

  if (const auto& failure = guide_.failure()) {
    phase_ = Phase::Failed;
    reason_ = failure->text;
  } else if (guide_.complete()) {
    phase_ = Phase::Complete;
    reason_ =
        fmt::format("{} touches at {} positions", guide_.taken(), request_.plan.positions.size());
  } else {
    report_next_step();
  }
}

void EvemuAcquisition::refuse(const protocol::Snapshot& touch, std::string_view fault) {
  const auto next = guide_.next();
  note(touch, fmt::format("not used: {}; expected: {}", fault, evemu::name(next.on)));
  if (++refused_in_a_row_ < options_.most_refused || phase_ != Phase::WaitingAtStart) return;
  phase_ = Phase::Failed;
  reason_ = fmt::format("{} successive touches could not be used; the last one: {}",
                        refused_in_a_row_, fault);
}

void EvemuAcquisition::note(const protocol::Snapshot& touch, const std::string& what) {
  notes_.push_back(fmt::format("{} touch {}: {}", options_.device, touch.trigger.touch, what));
}

void EvemuAcquisition::report_next_step() {
  const auto next = guide_.next();
  reason_ =
      fmt::format("position {} ({} of {}): touch {}, {} points", next.position, next.place + 1,
                  request_.plan.positions.size(), evemu::name(next.on), next.points);
}

void EvemuAcquisition::tick(HostTime now) {
  if (phase_ == Phase::Complete || phase_ == Phase::Failed ||
      now - last_touch_ <= options_.longest_pause)
    return;
  phase_ = Phase::Failed;
  reason_ = fmt::format("no touch for {:.0f} s; {}",
                        std::chrono::duration<double>(now - last_touch_).count(), reason_);
}

std::vector<std::string> EvemuAcquisition::take_notes() {
  return std::exchange(notes_, {});
}

EvemuRun EvemuAcquisition::release() {
  return {std::move(request_), guide_.touches(), thermometer_.over_the_run()};
}

}  // namespace abbe::daemon
