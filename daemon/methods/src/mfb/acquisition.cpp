#include "abbe/methods/mfb/acquisition.hpp"

#include <fmt/format.h>

#include <utility>

#include "abbe/config/calib_error.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "usable_touch.hpp"

namespace abbe::daemon {

namespace mfb = calib::mfb;

namespace {

using protocol::HostTime;

/// The earlier touches must all be taken: the guide takes the same touches again.
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
  if (!options.machine) return tl::unexpected(options.machine.error());
  auto bar = parse_bar_toml(request.bar.text, request.bar.name);
  if (!bar) return tl::unexpected(bar.error());
  auto plan = parse_bar_plan_toml(request.plan.text, request.plan.name, bar->bar);
  if (!plan) return tl::unexpected(plan.error());
  auto guide = mfb::TouchGuide::create(bar->bar, std::move(plan->plan), *options.machine);
  if (!guide)
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", request.plan.name, guide.error().text));
  if (const auto taken = take_earlier(*guide, request.earlier_m); !taken)
    return tl::unexpected(taken.error());
  return MfbAcquisition{
      std::move(bar->bar), {bar->source, plan->source}, *std::move(guide), std::move(options)};
}

MfbAcquisition::MfbAcquisition(mfb::Bar bar, std::vector<InputFile> sources, mfb::TouchGuide guide,
                               MfbAcquisitionOptions options)
    : bar_(std::move(bar)),
      sources_(std::move(sources)),
      guide_(std::move(guide)),
      options_(std::move(options)) {
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
  refused_in_a_row_ = 0;
  const calib::Vector3 reading_m{snapshot.position[0], snapshot.position[1], snapshot.position[2]};
  const mfb::GuidedTouch taken = guide_.take(reading_m);
  for (const std::string& text : taken.notes) note(snapshot, text);
  if (taken.fate == mfb::TouchFate::Taken) phase_ = Phase::Running;
  follow_guide();
}

/// Phase and instruction after a touch.
void MfbAcquisition::follow_guide() {
  const auto& plan = guide_.plan();
  if (const auto& failure = guide_.failure()) {
    phase_ = Phase::Failed;
    reason_ = failure->text;
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
  note(touch, fmt::format("not used: {}; expected: {}", fault, guide_.next_text()));
  if (++refused_in_a_row_ < options_.most_refused || phase_ != Phase::WaitingAtStart) return;
  phase_ = Phase::Failed;
  reason_ = fmt::format("{} successive touches could not be used; the last one: {}",
                        refused_in_a_row_, fault);
}

void MfbAcquisition::note(const protocol::Snapshot& touch, const std::string& what) {
  notes_.push_back(fmt::format("{} touch {}: {}", options_.device, touch.trigger.touch, what));
}

void MfbAcquisition::tick(HostTime now) {
  if (phase_ == Phase::Complete || phase_ == Phase::Failed ||
      now - last_touch_ <= options_.longest_pause)
    return;
  phase_ = Phase::Failed;
  reason_ = fmt::format(
      "no touch for {:.0f} s; {}; abbe calibrate mfb --continue uses the touches "
      "of the recording",
      std::chrono::duration<double>(now - last_touch_).count(), reason_);
}

std::vector<std::string> MfbAcquisition::take_notes() {
  return std::exchange(notes_, {});
}

std::vector<calib::Vector3> MfbAcquisition::readings_m() const {
  std::vector<calib::Vector3> all;
  for (const mfb::PassTouches& pass : guide_.passes())
    for (const mfb::Touch& touch : pass) all.push_back(touch.reading_m);
  return all;
}

MfbRun MfbAcquisition::release() {
  return {std::move(bar_), guide_.plan(), guide_.passes(), std::move(sources_)};
}

}  // namespace abbe::daemon
