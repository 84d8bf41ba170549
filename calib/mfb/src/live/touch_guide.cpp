#include "abbe/calib/mfb/live/touch_guide.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/result/try.hpp"
#include "live/guided_pass.hpp"

namespace abbe::calib::mfb {
namespace {

/// Number of passes discarded in succession after which the guide fails.
constexpr std::size_t kMostDiscarded = 2;

std::string list_of(const std::vector<std::string>& names) {
  constexpr std::size_t kMostNamed = 3;
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kMostNamed); ++i) {
    text += (i > 0 ? "; " : "") + names[i];
  }
  return names.size() > kMostNamed ? message(text, " and ", names.size() - kMostNamed, " more")
                                   : text;
}

}  // namespace

class TouchGuide::Session {
 public:
  Session(Bar bar, Plan plan, MfbMachine machine, const GuideOptions& options)
      : bar_(std::move(bar)),
        plan_(std::move(plan)),
        machine_(std::move(machine)),
        options_(options),
        nominal_(nominal_touches(bar_.pattern, plan_.tip_radius_m)),
        passes_(plan_.measurements.size()) {
    begin_pass();
  }

  [[nodiscard]] GuidedTouch take(const Vector3& reading_m);

  [[nodiscard]] bool complete() const { return at_ == plan_.measurements.size(); }
  [[nodiscard]] const std::optional<Error>& failure() const { return failure_; }
  [[nodiscard]] NextTouch next() const;
  [[nodiscard]] std::string next_text() const;
  [[nodiscard]] std::size_t taken() const;
  [[nodiscard]] std::size_t planned() const { return nominal_.size() * passes_.size(); }
  [[nodiscard]] const std::vector<PassTouches>& passes() const { return passes_; }
  [[nodiscard]] const Plan& plan() const { return plan_; }

 private:
  [[nodiscard]] const Measurement& measurement() const { return plan_.measurements[at_]; }
  [[nodiscard]] std::string where() const { return measurement().name + ": "; }
  [[nodiscard]] std::string place_name(std::size_t place) const {
    return name(nominal_[place].target);
  }
  [[nodiscard]] bool begins_next_pass(const Vector3& reading_m) const;
  void begin_pass();
  void end_pass(GuidedTouch& out);
  void put(std::size_t place, const Vector3& reading_m, GuidedTouch& out);
  void repeated(std::size_t place, const Vector3& reading_m, GuidedTouch& out) const;
  void off_place(const GuidedPass::Nearest& nearest, const Vector3& reading_m, GuidedTouch& out);
  [[nodiscard]] Result<void> checked() const;
  void discard(const std::string& why, GuidedTouch& out);
  void fail(std::string text) { failure_ = Error{ErrorCode::BadInput, std::move(text)}; }

  Bar bar_;
  Plan plan_;
  MfbMachine machine_;
  GuideOptions options_;
  std::vector<NominalTouch> nominal_;
  std::vector<PassTouches> passes_;
  std::size_t at_ = 0;  ///< index of the measurement that is being touched
  std::optional<GuidedPass> pass_;
  std::map<std::string, PoseOfTouches> poses_;  ///< by position
  std::size_t off_in_a_row_ = 0, discarded_in_a_row_ = 0;
  std::optional<Error> failure_;
};

void TouchGuide::Session::begin_pass() {
  const auto known = poses_.find(measurement().position);
  pass_.emplace(measurement(), nominal_, options_.limits,
                known == poses_.end() ? std::nullopt : std::optional(known->second));
}

/// True if the touch is at the first place of the next measurement. If that has another position,
/// the touch is where it begins. If it has the same position, the touch is in its first feature and
/// not at the place of the last touch.
bool TouchGuide::Session::begins_next_pass(const Vector3& reading_m) const {
  if (at_ + 1 == plan_.measurements.size() || !pass_->has_enough()) {
    return false;
  }
  const Measurement& m = plan_.measurements[at_ + 1];
  const auto known = poses_.find(m.position);
  const bool same_position = m.position == measurement().position;
  const GuidedPass following(m, nominal_, options_.limits,
                             same_position           ? pass_->pose()
                             : known == poses_.end() ? std::nullopt
                                                     : std::optional(known->second));
  const GuidedPass::Nearest nearest = following.nearest(reading_m);
  return nearest.off_m <= following.largest_off_m(options_.off_place_m) &&
         following.is_of_first_feature(nearest.place) &&
         !(same_position && pass_->last() == nearest.place);
}

GuidedTouch TouchGuide::Session::take(const Vector3& reading_m) {
  GuidedTouch out;
  if (complete() || failure_) {
    out.fate = TouchFate::NotOnBar;
    return out;
  }
  if (!reading_m.allFinite()) {
    out.fate = TouchFate::NotOnBar;
    out.notes.push_back(where() + "the reading is not a number; expected: " + next_text());
    return out;
  }

  const GuidedPass::Nearest nearest = pass_->nearest(reading_m);
  const bool on_place = nearest.off_m <= pass_->largest_off_m(options_.off_place_m);
  if ((!on_place || pass_->has(nearest.place)) && begins_next_pass(reading_m)) {
    end_pass(out);
    if (!complete() && !failure_) {
      GuidedTouch first = take(reading_m);
      first.notes.insert(first.notes.begin(), out.notes.begin(), out.notes.end());
      return first;
    }
    return out;
  }

  if (!on_place) {
    off_place(nearest, reading_m, out);
  } else if (pass_->has(nearest.place)) {
    repeated(nearest.place, reading_m, out);
  } else {
    put(nearest.place, reading_m, out);
  }
  return out;
}

void TouchGuide::Session::put(std::size_t place, const Vector3& reading_m, GuidedTouch& out) {
  off_in_a_row_ = 0;
  pass_->put(place, reading_m);
  passes_[at_] = pass_->touches();
  if (const std::vector<std::string> skipped = pass_->newly_skipped(); !skipped.empty()) {
    out.notes.push_back(where() + list_of(skipped) + " was not touched: touch it after the pass");
  }
  if (pass_->complete()) {
    end_pass(out);
  }
}

void TouchGuide::Session::repeated(std::size_t place, const Vector3& reading_m,
                                   GuidedTouch& out) const {
  const bool same = pass_->is_same_place(place, reading_m, options_.same_place_m);
  out.fate = same ? TouchFate::SamePlace : TouchFate::Doubled;
  out.notes.push_back(where() + place_name(place) +
                      (same ? " was touched twice; it counts once"
                            : " has its touch already: this one is not used") +
                      "; expected: " + place_name(pass_->next()));
}

void TouchGuide::Session::off_place(const GuidedPass::Nearest& nearest, const Vector3& reading_m,
                                    GuidedTouch& out) {
  out.fate = TouchFate::NotOnBar;
  std::string text = where() + message("the touch at the reading ", mm_text(reading_m), " is ",
                                       kMmPerM * nearest.off_m, " mm from the nearest place, ",
                                       place_name(nearest.place));
  // If two touches contradict each other, either of them may be wrong.
  if (pass_->touches().size() == 1) {
    pass_->clear();
    passes_[at_].clear();
    text += "; it and the first touch of the pass do not belong together: both are discarded";
  }
  out.notes.push_back(text + "; expected: " + place_name(pass_->next()));

  if (++off_in_a_row_ >= options_.most_off_place) {
    fail(message(
        off_in_a_row_, " touches one after the other are at no place of bar \"", bar_.name,
        "\": another bar, another plan, or a wrong tool offset; the last one: ", out.notes.back()));
  }
}

/// Checks features, orientation and calibrated places of the pass.
Result<void> TouchGuide::Session::checked() const {
  Plan alone = plan_;
  alone.measurements = {measurement()};
  return observe(bar_, alone, std::array{pass_->touches()}, machine_, options_.limits)
      .map([](const Observations&) {});
}

void TouchGuide::Session::end_pass(GuidedTouch& out) {
  if (const Result<void> valid = checked(); !valid) {
    discard(valid.error().text, out);
    return;
  }
  if (const std::size_t missing = nominal_.size() - pass_->touches().size(); missing > 0) {
    out.notes.push_back(where() +
                        message("ends without ", missing, " of ", nominal_.size(), " touches"));
  }
  discarded_in_a_row_ = 0;
  poses_.insert_or_assign(measurement().position, *pass_->pose());
  passes_[at_] = pass_->touches();
  if (++at_ < plan_.measurements.size()) {
    begin_pass();
  }
}

void TouchGuide::Session::discard(const std::string& why, GuidedTouch& out) {
  out.notes.push_back(why + "; the touches of " + measurement().name +
                      " are discarded: measure it again");
  passes_[at_].clear();
  pass_->clear();
  if (++discarded_in_a_row_ >= kMostDiscarded) {
    fail(message(discarded_in_a_row_, " passes were discarded one after the other: ", why));
  }
}

NextTouch TouchGuide::Session::next() const {
  const std::size_t place = pass_->next();
  const auto [touched, of] = pass_->count_of_feature(place);
  return {at_, nominal_[place].target, touched, of};
}

std::string TouchGuide::Session::next_text() const {
  const NextTouch n = next();
  return message(plan_.measurements[n.measurement].name, ": ", name(n.target), ", ", n.touched,
                 " of ", n.planned, " touches made");
}

std::size_t TouchGuide::Session::taken() const {
  std::size_t count = 0;
  for (const PassTouches& pass : passes_) {
    count += pass.size();
  }
  return count;
}

TouchGuide::TouchGuide(std::unique_ptr<Session> session) : session_(std::move(session)) {}
TouchGuide::TouchGuide(TouchGuide&&) noexcept = default;
TouchGuide& TouchGuide::operator=(TouchGuide&&) noexcept = default;
TouchGuide::~TouchGuide() = default;

Result<TouchGuide> TouchGuide::create(Bar bar, Plan plan, MfbMachine machine,
                                      GuideOptions options) {
  ABBE_TRY(planned_observations(bar, plan, machine));
  return TouchGuide(
      std::make_unique<Session>(std::move(bar), std::move(plan), std::move(machine), options));
}

GuidedTouch TouchGuide::take(const Vector3& reading_m) {
  return session_->take(reading_m);
}

bool TouchGuide::complete() const {
  return session_->complete();
}

const std::optional<Error>& TouchGuide::failure() const {
  return session_->failure();
}

NextTouch TouchGuide::next() const {
  return session_->next();
}

std::string TouchGuide::next_text() const {
  return session_->next_text();
}

std::size_t TouchGuide::taken() const {
  return session_->taken();
}

std::size_t TouchGuide::planned() const {
  return session_->planned();
}

const std::vector<PassTouches>& TouchGuide::passes() const {
  return session_->passes();
}

const Plan& TouchGuide::plan() const {
  return session_->plan();
}

}  // namespace abbe::calib::mfb
