#include "abbe/calib/evemu/live/touch_guide.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/result/try.hpp"
#include "live/touch_site.hpp"

namespace abbe::calib::evemu {
namespace {

// Number of features or positions discarded in succession after which the guide fails.
constexpr std::size_t kMostDiscarded = 2;

Result<void> check_plan(const TouchPlan& plan, const ObserveOptions& observe) {
  std::vector<int> sorted = plan.positions, expected(plan.positions.size());
  std::ranges::sort(sorted);
  std::iota(expected.begin(), expected.end(), 1);

  if (sorted.empty() || sorted != expected) {
    return failure(ErrorCode::BadInput,
                   message("touch plan: positions must be 1 to ", sorted.size(), ", each once"));
  }

  if (plan.points_per_ball < observe.least_points_per_ball ||
      plan.points_per_block < observe.least_points_per_block) {
    return failure(ErrorCode::BadInput,
                   message("touch plan: needs at least ", observe.least_points_per_ball,
                           " points a ball and ", observe.least_points_per_block, " a block"));
  }

  return {};
}

std::string place_text(const Vector3& p_m) {
  const Vector3 mm = kMmPerM * p_m;
  return message("(", mm.x(), ", ", mm.y(), ", ", mm.z(), ") mm");
}

}  // namespace

std::string name(const TouchedFeature& f) {
  return message(f.feature == Feature::Ball ? "ball " : "block ", f.number);
}

struct TouchGuide::Setup {
  Calibrator calibrator;
  TouchPlan plan;
  GuideOptions options;
};

TouchGuide::TouchGuide(std::unique_ptr<const Setup> setup) : setup_(std::move(setup)) {
  begin_position();
}
TouchGuide::TouchGuide(TouchGuide&&) noexcept = default;
TouchGuide& TouchGuide::operator=(TouchGuide&&) noexcept = default;
TouchGuide::~TouchGuide() = default;

Result<TouchGuide> TouchGuide::create(Calibrator calibrator, TouchPlan plan, GuideOptions options) {
  ABBE_TRY(check(calibrator));
  ABBE_TRY(check_plan(plan, options.observe));
  return TouchGuide(
      std::make_unique<const Setup>(Setup{std::move(calibrator), std::move(plan), options}));
}

const TouchPlan& TouchGuide::plan() const {
  return setup_->plan;
}

std::size_t TouchGuide::points_of(std::size_t feature) const {
  const bool ball = feature_at(feature).feature == Feature::Ball;
  return ball ? plan().points_per_ball : plan().points_per_block;
}

std::size_t TouchGuide::least_of(std::size_t feature) const {
  const ObserveOptions& observe = setup_->options.observe;
  const bool ball = feature_at(feature).feature == Feature::Ball;
  return ball ? observe.least_points_per_ball : observe.least_points_per_block;
}

bool TouchGuide::has_enough(std::size_t feature) const {
  return site_->points(feature).size() >= least_of(feature);
}

bool TouchGuide::all_have_enough() const {
  for (std::size_t f = 0; f < passed_.size(); ++f) {
    if (!has_enough(f)) return false;
  }
  return true;
}

std::string TouchGuide::where() const {
  return message("position ", plan().positions[place_], ": ");
}

/// Text such as "ball 3 has 24 of 25 points".
std::string TouchGuide::tally(std::size_t feature) const {
  return message(name(feature_at(feature)), " has ", site_->points(feature).size(), " of ",
                 points_of(feature), " points");
}

NextTouch TouchGuide::next() const {
  return {plan().positions[place_], place_, feature_at(feature_), site_->points(feature_).size(),
          points_of(feature_)};
}

std::vector<FeatureProgress> TouchGuide::features() const {
  std::vector<FeatureProgress> all;
  for (std::size_t f = 0; f < passed_.size(); ++f) {
    auto& seen = all.emplace_back(FeatureProgress{
        .on = feature_at(f), .touched = site_->points(f).size(), .points = points_of(f)});
    if (seen.on.feature == Feature::Ball) {
      seen.at_m = site_->centre_m(static_cast<std::size_t>(seen.on.number) - 1);
    } else if (const auto face = site_->face(f)) {
      seen.at_m = face->point;
      seen.normal = site_->normal(f);
    }
  }

  return all;
}

std::size_t TouchGuide::planned() const {
  const std::size_t balls = setup_->calibrator.balls.size();
  return plan().positions.size() * (balls * plan().points_per_ball + 2 * plan().points_per_block);
}

std::size_t TouchGuide::taken() const {
  std::size_t count = finished_.size();
  for (std::size_t f = 0; f < passed_.size(); ++f) count += site_->points(f).size();
  return count;
}

std::vector<Touch> TouchGuide::touches() const {
  std::vector<Touch> all = finished_;
  if (complete()) return all;
  const std::vector<Touch> here = site_->touches(plan().positions[place_]);
  all.insert(all.end(), here.begin(), here.end());
  return all;
}

void TouchGuide::begin_position() {
  site_ = std::make_unique<Site>(setup_->calibrator, setup_->options, site_.get());
  passed_.assign(setup_->calibrator.balls.size() + 2, false);
  feature_ = kBall1;
}

GuidedTouch TouchGuide::take(const Vector3& p_m) {
  GuidedTouch out;
  if (complete() || failure_) {
    out.fate = TouchFate::NotOnFeature;
    return out;
  }

  const auto feature = site_->feature_of(p_m, feature_);
  if (!feature) {
    astray(p_m, out);
    return out;
  }

  astray_in_a_row_ = 0;
  if (site_->has_point_near(*feature, p_m)) {
    out.fate = TouchFate::SamePlace;
    out.notes.push_back(where() + message("the same place on ", name(feature_at(*feature)),
                                          " was touched twice; it counts once"));
  } else if (site_->points(*feature).size() >= points_of(*feature)) {
    on_complete_feature(*feature, p_m, out);
  } else {
    put(*feature, p_m, out);
  }

  return out;
}

void TouchGuide::astray(const Vector3& p_m, GuidedTouch& out) {
  out.fate = TouchFate::NotOnFeature;
  std::string text = where() + message("the touch at ", place_text(p_m), " is on no ball or block");
  std::size_t ball = 0;
  if (const double off_m = site_->nearest_ball_m(p_m, ball); std::isfinite(off_m))
    text += message("; nearest is ball ", ball + 1, ", ", kMmPerM * off_m, " mm away");
  else if (site_->points(kBall1).size() == 1) {
    // There are only two touches, which do not show which of them was wrong: both are discarded.
    site_->clear(kBall1);
    text = where() + message("the touch at ", place_text(p_m),
                             " and the one before are not on one ball: both are discarded");
  }

  out.notes.push_back(text + "; expected: " + name(feature_at(feature_)));
  if (++astray_in_a_row_ < setup_->options.most_off_feature) return;
  fail(ErrorCode::BadInput,
       message(astray_in_a_row_,
               " touches one after the other are on no ball or block of calibrator \"",
               setup_->calibrator.name,
               "\": calibrator file of another artefact, or touches in another order; the last "
               "one: ",
               out.notes.back()));
}

/// Handles a touch on a feature that already has all its points. If the touch is on Ball1 and no
/// feature lacks points, it is the first touch of the next position.
void TouchGuide::on_complete_feature(std::size_t feature, const Vector3& p_m, GuidedTouch& out) {
  if (feature == kBall1 && feature_ != kBall1 && all_have_enough()) {
    if (skip_to(passed_.size(), out) && all_have_enough()) {
      end_position(out);
      if (!complete() && !failure_) return put(kBall1, p_m, out);
    }
    out.fate = TouchFate::Doubled;
    return;
  }
  out.fate = TouchFate::Doubled;
  out.notes.push_back(
      where() +
      message(name(feature_at(feature)), " has all its ", points_of(feature),
              " points: this touch is not needed; expected: ", name(feature_at(feature_))));
}

void TouchGuide::put(std::size_t feature, const Vector3& p_m, GuidedTouch& out) {
  if (feature > feature_ && !skip_to(feature, out)) {
    out.fate = TouchFate::NotOnFeature;  // the discarded feature was needed to assign this touch
    return;
  }
  feature_ = feature;
  site_->add(feature, p_m);
  if (site_->points(feature).size() == points_of(feature) && accept_feature(feature, out))
    expect_next_after(feature, out);
}

/// Called when the operator touches `feature`, which comes after the expected one. Reports the
/// points missing on the features before `feature`; a feature with too few points is requested
/// again at the end of the position. False if the guide failed, or if a feature was discarded: the
/// discarded feature is then expected next.
bool TouchGuide::skip_to(std::size_t feature, GuidedTouch& out) {
  for (std::size_t f = feature_; f < feature; ++f) {
    const std::size_t points = site_->points(f).size();
    if (points >= points_of(f) || passed_[f]) continue;
    passed_[f] = true;
    if (points == 0) {
      out.notes.push_back(where() + name(feature_at(f)) + " was left out; it is asked for again");
    } else {
      out.notes.push_back(
          where() + tally(f) +
          (has_enough(f) ? ", the rest was missed" : ": too few, it is asked for again"));
    }
    if (points < least_of(f)) continue;
    (void)accept_feature(f, out);
    if (failure_ || site_->points(f).empty()) return false;
  }

  return true;
}

bool TouchGuide::accept_feature(std::size_t feature, GuidedTouch& out) {
  const FeatureCheck seen = site_->check(feature);
  const std::string which = name(feature_at(feature));
  if (seen.outlier) {
    const Vector3 p_m = site_->points(feature)[*seen.outlier];
    site_->drop(feature, *seen.outlier);
    out.notes.push_back(where() + message("the touch at ", place_text(p_m), " is ",
                                          kMmPerM * seen.off_m, " mm off the others of ", which,
                                          ": discarded, touch another point"));
    return false;
  }

  if (seen.other_radius_m && feature == kBall1 && place_ == 0) {
    const Calibrator& c = setup_->calibrator;
    fail(ErrorCode::BadInput,
         message("ball 1 has radius ", kMmPerM * *seen.other_radius_m, " mm, calibrator \"", c.name,
                 "\" and tip give ", kMmPerM * (c.balls.front().radius_m + c.tip_radius_m),
                 " mm: calibrator file of another artefact, or another tip"));
    return false;
  }

  if (!seen.valid) {
    discard_feature(feature, "the points of " + which + " do not fit its surface", out);
    return false;
  }

  const bool both_faces = has_enough(kBlock1) && has_enough(kBlock2);
  if ((feature == kBlock1 || feature == kBlock2) && both_faces &&
      site_->faces_off_rad() > setup_->options.observe.max_block_tilt_rad) {
    const double off_mrad = kMmPerM * site_->faces_off_rad();
    site_->clear(kBlock1);
    passed_[kBlock1] = false;
    discard_feature(
        kBlock2,
        message("the angle of the two faces is ", off_mrad, " mrad off the calibrator's angle"),
        out);
    feature_ = kBlock1;
    return false;
  }

  if (feature > kBlock2) accept_ball(feature, out);
  return true;
}

void TouchGuide::accept_ball(std::size_t feature, GuidedTouch& out) {
  const std::size_t dropped = site_->accept_ball(feature);
  if (dropped == 0) return;
  out.notes.push_back(where() + message(dropped,
                                        dropped == 1 ? " earlier touch is" : " earlier touches are",
                                        " on no ball, as ", name(feature_at(feature)),
                                        " shows where all balls are: discarded"));
  for (std::size_t f = feature + 1; f < passed_.size(); ++f) {
    if (!has_enough(f)) passed_[f] = false;  // only a stray touch had skipped the feature
  }
}

void TouchGuide::expect_next_after(std::size_t feature, GuidedTouch& out) {
  for (std::size_t f = feature + 1; f < passed_.size(); ++f) {
    if (site_->points(f).size() >= points_of(f) || passed_[f]) continue;
    feature_ = f;
    return;
  }
  for (std::size_t f = 0; f < passed_.size(); ++f) {
    if (has_enough(f)) continue;
    feature_ = f;
    return;
  }
  end_position(out);
}

void TouchGuide::end_position(GuidedTouch& out) {
  const int position = plan().positions[place_];
  const std::vector<Touch> touches = site_->touches(position);
  const auto seen = see_artefact(position, touches, setup_->calibrator, setup_->options.observe);

  if (!seen) return discard_position(seen.error().text, out);
  if (const auto before =
          same_orientation_as(seen->T_self_uni.R, seen_, setup_->options.observe.least_turn_rad))
    return discard_position(
        where() + message("the artefact has the same orientation as at position ",
                          plan().positions[*before], ": turn it"),
        out);

  site_->keep_sides();
  finished_.insert(finished_.end(), touches.begin(), touches.end());
  seen_.push_back(seen->T_self_uni.R);
  discarded_in_a_row_ = 0;
  ++place_;
  begin_position();
}

void TouchGuide::discard_feature(std::size_t feature, const std::string& why, GuidedTouch& out) {
  const std::string text = where() + why;
  site_->clear(feature);
  passed_[feature] = false;
  feature_ = feature;
  out.notes.push_back(text + ": its touches are discarded, touch it again");
  if (++discarded_in_a_row_ >= kMostDiscarded) fail(ErrorCode::BadInput, text + ", again");
}

void TouchGuide::discard_position(const std::string& why, GuidedTouch& out) {
  begin_position();
  out.notes.push_back(why +
                      ": the touches of this position are discarded, touch it again from ball 1");
  if (++discarded_in_a_row_ >= kMostDiscarded) fail(ErrorCode::BadInput, why + ", again");
}

void TouchGuide::fail(ErrorCode code, std::string text) {
  failure_ = Error{code, std::move(text)};
}

}  // namespace abbe::calib::evemu
