#include "abbe/sim/weak_stiffness.hpp"

#include <cmath>

#include "units.hpp"

namespace abbe::sim {
namespace {

constexpr double kBall1_mm[3] = {-90.0, 140.0, 30.0};

/// Error motion as a polynomial of the scale reading p in mm:
///   c0 + c1 p + c2 p^2 + c3 p^3
/// The value is in mm for translations, in rad for rotations.
struct Cubic {
  double c0 = 0.0, c1 = 0.0, c2 = 0.0, c3 = 0.0;
  [[nodiscard]] double at(double p_mm) const { return c0 + p_mm * (c1 + p_mm * (c2 + p_mm * c3)); }
};

ErrorFunction translation(const Cubic& c) {
  return ErrorFunction::polynomial(
      {c.c0 / kMmPerM, c.c1, c.c2 * kMmPerM, c.c3 * kMmPerM * kMmPerM});
}
ErrorFunction rotation(const Cubic& c) {
  return ErrorFunction::polynomial(
      {c.c0, c.c1 * kMmPerM, c.c2 * kMmPerM * kMmPerM, c.c3 * kMmPerM * kMmPerM * kMmPerM});
}

ErrorFunction& motion(TruthMachine& truth, Motion which, Axis axis) {
  return truth.axis(axis).error[static_cast<std::size_t>(which)];
}

}  // namespace

TruthMachine weak_stiffness_machine(const WeakStiffnessOptions& options) {
  TruthMachine truth;
  truth.order = {Axis::Z, Axis::X, Axis::Y};
  truth.axis(Axis::X).range = {-0.15, 0.65, 0.0};
  truth.axis(Axis::Y).range = {-0.15, 0.40, 0.0};
  truth.axis(Axis::Z).range = {-0.05, 0.15, 0.0};

  // Error motions of axis X as functions of x. The linear terms of its straightness are k_eqy1 and
  // k_eqz1 of Table 3.
  const Cubic dxx{0, 0.00295049, 3.813183e-06, -2.775042e-09};
  const Cubic dyx{0, 0.002007601, 1.167908e-06, 1.848295e-10};
  const Cubic dzx{0, 0.00251692, -1.747859e-06, -9.975762e-10};
  const Cubic exx{0, 6.939124e-06, 6.795187e-09, -2.011528e-11};
  const Cubic ezx{0, 2.169027e-06, 0, -3.121463e-12};
  // Error motions of axis Y as functions of y. The linear terms of its straightness are k_eqx1 and
  // k_eqz2.
  const Cubic dxy{0, 0.0004290736, -1.785525e-05, 5.11703e-08};
  const Cubic dyy{0, 0.0002017827, 0, -1.832424e-08};
  const Cubic dzy{0, -0.001512266, 1.548582e-05, -7.038459e-08};
  // Caused by Z.
  Cubic dxz{0, 0.0166986, -0.0003462166, 2.035311e-06};
  Cubic dyz{0, 0.05660915, -0.001673767, 1.599664e-05};
  Cubic dzz{0, 0, -0.0001328144, -3.380137e-10};
  const Cubic exz{0, -2.410024e-05, 4.178833e-10, 8.430376e-09};
  const Cubic eyz{0, -3.560507e-05, 0, 5.256019e-09};
  const Cubic ezz{0, -5.102954e-05, 1.537837e-07, -3.872882e-09};

  motion(truth, Motion::EX, Axis::X) =
      translation(dxx).with_wave(options.periodic_m, options.period_m);
  motion(truth, Motion::EY, Axis::X) = translation(dyx);
  motion(truth, Motion::EZ, Axis::X) = translation(dzx);
  motion(truth, Motion::EA, Axis::X) = rotation(exx);
  motion(truth, Motion::EC, Axis::X) = rotation(ezx);
  motion(truth, Motion::EX, Axis::Y) = translation(dxy);
  motion(truth, Motion::EY, Axis::Y) = translation(dyy);
  motion(truth, Motion::EZ, Axis::Y) = translation(dzy);
  motion(truth, Motion::EA, Axis::Z) = rotation(exz);
  motion(truth, Motion::EB, Axis::Z) = rotation(eyz);
  motion(truth, Motion::EC, Axis::Z) = rotation(ezz);

  // With the constants of Table 3, V at ball 1 is about 0.05 mm. The constant terms of axis Z are
  // adjusted so that V at ball 1 is 0.
  const auto set_z = [&] {
    motion(truth, Motion::EX, Axis::Z) = translation(dxz);
    motion(truth, Motion::EY, Axis::Z) = translation(dyz);
    motion(truth, Motion::EZ, Axis::Z) = translation(dzz);
  };
  const Eigen::Vector3d ball1_m =
      Eigen::Vector3d(kBall1_mm[0], kBall1_mm[1], kBall1_mm[2]) / kMmPerM;
  set_z();
  const Eigen::Vector3d off_mm = kMmPerM * error_m(truth, ball1_m);
  dxz.c0 -= off_mm.x();
  dyz.c0 -= off_mm.y();
  dzz.c0 -= off_mm.z();
  set_z();
  truth.sag_m = options.sag_m;
  return truth;
}

}  // namespace abbe::sim
