#pragma once
/// One position of the ball array while it is being touched: the points of every feature, and where
/// the features are as far as these tell. Features by measuring order: 0 Ball1, 1 and 2 the blocks,
/// 3 Ball2, ...

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/evemu/touch_guide.hpp"

namespace abbe::calib::evemu {

inline constexpr std::size_t kBall1 = 0, kBlock1 = 1, kBlock2 = 2;  ///< in this order

[[nodiscard]] TouchedFeature feature_at(std::size_t order);

/// What the points of a feature say of themselves.
struct FeatureCheck {
  bool fine = false;
  std::optional<std::size_t> outlier{};    ///< without this one it would be
  double off_m = 0.0;                      ///< of the outlier, from the surface of the others
  std::optional<double> other_radius_m{};  ///< they lie on one sphere, but not on this ball's
};

class Site {
 public:
  /// `before`: the position before, for what stays as it was; may be null. References must outlive
  /// the site.
  Site(const Calibrator&, const GuideOptions&, const Site* before);

  /// The feature that p lies on; nothing: none known. `expected` decides where the features
  /// themselves cannot.
  [[nodiscard]] std::optional<std::size_t> feature_of(const Vector3& p_m,
                                                      std::size_t expected) const;
  /// Distance to the surface of the nearest ball known, which it is in `ball`; infinity before any
  /// is.
  [[nodiscard]] double nearest_ball_m(const Vector3& p_m, std::size_t& ball) const;

  [[nodiscard]] const std::vector<Vector3>& points(std::size_t feature) const {
    return points_[feature];
  }
  [[nodiscard]] bool has_point_near(std::size_t feature, const Vector3& p_m) const;
  void add(std::size_t feature, const Vector3& p_m);
  void drop(std::size_t feature, std::size_t point);
  void clear(std::size_t feature);
  /// A ball, all of whose points are sound: it decides to which sides the faces look. Gives the
  /// number of touches of other balls that lie on none with these sides; they are gone.
  std::size_t accept_ball(std::size_t feature);
  /// The position is finished: the next one may rely on what was decided.
  void keep_sides();
  [[nodiscard]] FeatureCheck check(std::size_t feature) const;
  /// Both faces are there: the angle between them less the calibrator's.
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
  [[nodiscard]] std::optional<fit::Plane> face(std::size_t block) const;
  [[nodiscard]] bool is_sided(const fit::Plane& face) const;
  [[nodiscard]] std::vector<double> possible_sides(std::size_t block, const fit::Plane& face) const;
  void place_balls();

  /// Places of all balls if the faces look to these sides: 1, a face looks away from Ball1; -1,
  /// towards it.
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
  std::optional<Vector3> ball1_m_;
  std::array<std::optional<double>, 2> sides_;  ///< known from the positions before
  std::vector<std::vector<Vector3>> points_;
  std::vector<bool> accepted_;         ///< balls
  std::vector<Candidate> candidates_;  ///< those no accepted ball has contradicted
};

}  // namespace abbe::calib::evemu
