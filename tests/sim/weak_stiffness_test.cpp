#include "abbe/sim/weak_stiffness.hpp"

#include <gtest/gtest.h>

#include "abbe/sim/touching.hpp"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;

const Vector3d kBall1_m{-0.09, 0.14, 0.03};

TEST(WeakStiffnessMachine, HasNoErrorAtBallOne) {
  EXPECT_LT(error_m(weak_stiffness_machine(), kBall1_m).norm(), 1e-12);
}

/// The polynomials of [Li OMM] eq. (5), evaluated here at one reading. The remaining difference is
/// the second order of the exact transforms: rotations near 1 mrad times displacements near 3 mm.
TEST(WeakStiffnessMachine, HasTheErrorsOfTableThree) {
  const double x = 400, y = 200, z = 40;
  const auto E_mm = [](double X, double Y, double Z) -> Vector3d {
    const double ezx = 2.169027e-06 * X - 3.121463e-12 * X * X * X;
    const double ezz = -5.102954e-05 * Z + 1.537837e-07 * Z * Z - 3.872882e-09 * Z * Z * Z;
    const double exx = 6.939124e-06 * X + 6.795187e-09 * X * X - 2.011528e-11 * X * X * X;
    const double exz = -2.410024e-05 * Z + 4.178833e-10 * Z * Z + 8.430376e-09 * Z * Z * Z;
    const double eyz = -3.560507e-05 * Z + 5.256019e-09 * Z * Z * Z;
    return {0.00295049 * X + 3.813183e-06 * X * X - 2.775042e-09 * X * X * X + 0.0004290736 * Y -
                1.785525e-05 * Y * Y + 5.11703e-08 * Y * Y * Y + 0.0166986 * Z -
                0.0003462166 * Z * Z + 2.035311e-06 * Z * Z * Z - Y * ezx - Y * ezz,
            0.002007601 * X + 1.167908e-06 * X * X + 1.848295e-10 * X * X * X + 0.0002017827 * Y -
                1.832424e-08 * Y * Y * Y + 0.05660915 * Z - 0.001673767 * Z * Z +
                1.599664e-05 * Z * Z * Z + X * ezz,
            0.00251692 * X - 1.747859e-06 * X * X - 9.975762e-10 * X * X * X - 0.001512266 * Y +
                1.548582e-05 * Y * Y - 7.038459e-08 * Y * Y * Y - 0.0001328144 * Z * Z -
                3.380137e-10 * Z * Z * Z + Y * exx + Y * exz - X * eyz};
  };

  const Vector3d expected_mm = E_mm(x, y, z) - E_mm(-90, 140, 30);
  const Vector3d V_mm = 1e3 * error_m(weak_stiffness_machine(), Vector3d(x, y, z) / 1e3);

  EXPECT_GT(V_mm.norm(), 1.0);
  EXPECT_LT((V_mm - expected_mm).norm(), 0.02);
}

TEST(WeakStiffnessMachine, HasSagAndPeriodicErrorOnlyOnRequest) {
  const Vector3d q_m{0.25, 0.5, 0.03};
  const Vector3d plain = error_m(weak_stiffness_machine(), q_m);
  const Vector3d sagging = error_m(weak_stiffness_machine({.sag_m = 10e-6}), q_m);
  EXPECT_NEAR(sagging.z() - plain.z(), -10e-6, 1e-9);
  const Vector3d crest_m{0.245, 0.5, 0.03};  // 12 and a quarter turns of 20 mm
  const Vector3d waved = error_m(weak_stiffness_machine({.periodic_m = 2e-6}), crest_m);
  EXPECT_NEAR(waved.x() - error_m(weak_stiffness_machine(), crest_m).x(), 2e-6, 1e-8);
}

TEST(ReadingAt, PutsTheTipAtTheGivenPosition) {
  const TruthMachine truth = weak_stiffness_machine();
  const Vector3d place_m{0.5, 0.2, 0.06};
  EXPECT_LT((position_m(truth, reading_at_m(truth, place_m)) - place_m).norm(), 1e-15);
}

}  // namespace
}  // namespace abbe::sim
