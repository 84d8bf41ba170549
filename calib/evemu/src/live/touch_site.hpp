#pragma once
/// One position of the ball array while it is being touched: the points of every feature, and the
/// places of the features that follow from these points. Feature index in measuring order: 0 Ball1,
/// 1 and 2 the blocks, 3 Ball2, ...

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/evemu/live/touch_guide.hpp"

namespace abbe::calib::evemu {

inline constexpr std::size_t kBall1 = 0, kBlock1 = 1, kBlock2 = 2;  ///< feature indices

[[nodiscard]] TouchedFeature feature_at(std::size_t order);

/// Check of the points of one feature against the surface of the feature.
struct FeatureCheck {
  bool valid = false;
  std::optional<std::size_t> outlier{};  ///< index of a point without which the others are valid
  double off_m = 0.0;  ///< distance of the outlier from the surface through the others
  std::optional<double> other_radius_m{};  ///< the points lie on a sphere of this other radius
};

class Site {
 public:
  /// `before`: the previous position, from which the place of Ball1 and the known sides of the
  /// faces are copied; may be null. The calibrator and the options must outlive the site.
  Site(const Calibrator&, const GuideOptions&, const Site* before);

  /// The feature on which p lies; nullopt: on no known feature. If the known places of the features
  /// do not decide on which feature p lies, the feature `expected` next does.
  [[nodiscard]] std::optional<std::size_t> feature_of(const Vector3& p_m,
                                                      std::size_t expected) const;
  /// Distance to the surface of the nearest ball with a known place, and its index in `ball`;
  /// infinity if no place is known.
  [[nodiscard]] double nearest_ball_m(const Vector3& p_m, std::size_t& ball) const;

  /// Centre of a ball; `ball`: index from 0. nullopt: the touches of this position do not determine
  /// it yet.
  [[nodiscard]] std::optional<Vector3> centre_m(std::size_t ball) const;
  /// The calibrator's normal of a block in machine coordinates; nullopt: the touches do not
  /// determine yet to which side the face points.
  [[nodiscard]] std::optional<Vector3> normal(std::size_t block) const;
  /// The plane of a touched face, with the normal away from Ball1; nullopt: too few points.
  [[nodiscard]] std::optional<fit::Plane> face(std::size_t block) const;
  [[nodiscard]] const std::vector<Vector3>& points(std::size_t feature) const {
    return points_[feature];
  }
  [[nodiscard]] bool has_point_near(std::size_t feature, const Vector3& p_m) const;
  void add(std::size_t feature, const Vector3& p_m);
  void drop(std::size_t feature, std::size_t point);
  void clear(std::size_t feature);
  /// Accepts a ball whose points are all valid. The accepted ball determines the sides to which the
  /// faces point, and so the places of all balls. Touches that now lie on no ball are removed;
  /// returns the number of removed touches.
  std::size_t accept_ball(std::size_t feature);
  /// Call when the position is finished: keeps the sides of the faces for the next position.
  void keep_sides();
  [[nodiscard]] FeatureCheck check(std::size_t feature) const;
  /// Absolute difference between the measured angle of the two faces and their angle in the
  /// calibrator; pi if a face has too few points.
  [[nodiscard]] double faces_off_rad() const;
  [[nodiscard]] std::vector<Touch> touches(int position) const;

 private:
  [[nodiscard]] double radius_m(std::size_t feature) const;
  [[nodiscard]] double extent_m() const;
  [[nodiscard]] bool near_first_ball(const Vector3& p_m) const;
  [[nodiscard]] bool on_face(std::size_t block, const Vector3& p_m) const;
  [[nodiscard]] std::optional<std::size_t> face_of(const Vector3& p_m, std::size_t expected) const;
  [[nodiscard]] std::optional<std::size_t> ball_of(const Vector3& p_m, std::size_t expected) const;
  [[nodiscard]] FeatureCheck check_ball(std::size_t feature) const;
  [[nodiscard]] FeatureCheck check_face(std::size_t feature) const;
  [[nodiscard]] bool is_sided(const fit::Plane& face) const;
  [[nodiscard]] std::vector<double> possible_sides(std::size_t block, const fit::Plane& face) const;
  void place_balls();

  /// Places of all balls under an assumption about the sides to which the faces point. side = 1:
  /// away from Ball1; -1: towards it.
  struct Candidate {
    std::array<double, 2> side{};
    std::vector<Vector3> centres_m;
  };
  [[nodiscard]] double off_ball_m(const Candidate& candidate, std::size_t ball,
                                  const Vector3& p_m) const;
  [[nodiscard]] std::size_t nearest_ball(const Candidate& candidate, const Vector3& p_m) const;
  void rule_out_by(std::size_t feature);

  const Calibrator& calibrator_;
  const GuideOptions& options_;
  std::optional<Vector3> ball1_m_;  ///< until Ball1 is touched at this position, its place at the
                                    ///< previous position
  bool ball1_measured_ = false;     ///< Ball1 has been measured at this position
  std::array<std::optional<double>, 2> sides_;  ///< known from previous positions
  std::vector<std::vector<Vector3>> points_;    ///< points of each feature
  std::vector<bool> accepted_;                  ///< by feature; only balls are accepted
  std::vector<Candidate> candidates_;           ///< assumptions that agree with all accepted balls
};

}  // namespace abbe::calib::evemu
