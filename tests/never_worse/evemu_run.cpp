#include "evemu_run.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/calib/geometry/rigid_transform.hpp"
#include "random_numbers.hpp"

namespace abbe::tests::never_worse {
namespace {

namespace evemu = calib::evemu;
using Eigen::Isometry3d;

const std::array<const char*, 6> kChains{"[w X' b Y Z t]", "[w Y' b X Z t]", "[w X' Z' b Y t]",
                                         "[w b Z X Y t]",  "[w b Y Z X t]",  "[w Z' b Y X t]"};

/// Balls in an L shape, Ball1 at the origin, and two blocks beside the long leg.
sim::BallArray random_array(std::mt19937_64& random) {
  sim::BallArray array;
  array.name = "L";
  const std::size_t long_leg = 5 + random() % 3, short_leg = 2 + random() % 2;
  const double step_m = uniform(random, 0.07, 0.11), radius_m = uniform(random, 8e-3, 13e-3);
  const double across_m = uniform(random, 0.05, 0.08);
  const double gap_m = random() % 2 == 0 ? step_m : 0.0;  // space for the blocks beside Ball1

  for (std::size_t i = 0; i < long_leg; ++i) {
    array.balls.push_back(
        {Vector3(static_cast<double>(i) * step_m + (i > 0 ? gap_m : 0.0), 0, 0), radius_m});
  }

  const double end_m = array.balls.back().centre_m.x();
  for (std::size_t i = 1; i <= short_leg; ++i) {
    array.balls.push_back({Vector3(end_m, -static_cast<double>(i) * across_m, 0), radius_m});
  }

  array.faces[0] = {.centre_m = Vector3(0.5 * step_m, 0, 0.025), .normal = Vector3::UnitZ()};
  array.faces[1] = {.centre_m = Vector3(0.5 * step_m, 0.025, 0), .normal = Vector3::UnitY()};
  array.tip_radius_m = uniform(random, 0.5e-3, 3e-3);

  return array;
}

/// Positions rotated about Ball1 as in [Li OMM]. Tilt and roll are 2 to 5 degrees as in [Li OMM],
/// with which the scale of the axis across the array is poorly observable, or up to four times as
/// large.
std::vector<Isometry3d> random_positions(std::mt19937_64& random, const Vector3& ball1_m,
                                         std::size_t count) {
  constexpr double kRadPerDeg = M_PI / 180.0;
  const double tilt_factor = uniform(random, 1.0, 4.0);
  std::vector<Isometry3d> positions;

  for (std::size_t i = 0; i < count; ++i) {
    const double fan = 16.0 - 14.0 * static_cast<double>(i % 4) / 3.0 + uniform(random, -1.0, 1.0);
    const double tilt = (i % 8 < 4 ? 1.0 : -1.0) * tilt_factor * uniform(random, 1.8, 3.2);
    const double roll = (i % 2 == 0 ? 1.0 : -1.0) * tilt_factor * uniform(random, 2.5, 5.0);
    Isometry3d T = Isometry3d::Identity();
    T.translate(ball1_m + 50e-6 * normal3(random));  // placed by hand
    T.rotate(Eigen::AngleAxisd(fan * kRadPerDeg, Vector3::UnitZ()));
    T.rotate(Eigen::AngleAxisd(-tilt * kRadPerDeg, Vector3::UnitY()));
    T.rotate(Eigen::AngleAxisd(roll * kRadPerDeg, Vector3::UnitX()));
    positions.push_back(T);
  }

  return positions;
}

/// sum_k c_k P_k((q - centre) / half), k = 1 .. 3, as a polynomial of q in m. P_k: Legendre
/// polynomials.
sim::ErrorFunction cubic(const std::array<double, 3>& c, double centre_m, double half_m) {
  // The sum as a polynomial in u = (q - centre) / half:
  //     c1 u + c2 (1.5 u^2 - 0.5) + c3 (2.5 u^3 - 1.5 u)
  const std::array<double, 4> in_u{-0.5 * c[1], c[0] - 1.5 * c[2], 1.5 * c[1], 2.5 * c[2]};
  std::vector<double> in_q(4, 0.0);
  const std::array<std::array<double, 4>, 4> binomial{
      {{1, 0, 0, 0}, {1, 1, 0, 0}, {1, 2, 1, 0}, {1, 3, 3, 1}}};
  for (std::size_t k = 0; k < 4; ++k) {
    for (std::size_t j = 0; j <= k; ++j) {
      in_q[j] += in_u[k] * binomial[k][j] * std::pow(-centre_m, static_cast<double>(k - j)) /
                 std::pow(half_m, static_cast<double>(k));
    }
  }
  return sim::ErrorFunction::polynomial(std::move(in_q));
}

/// Errors of order 3 in the readings with amplitude `size`. The linear error of an axis along
/// itself is a scale error, relative to its travel.
void draw_errors(EvemuRun& run, double size) {
  std::mt19937_64& random = run.random;
  double longest_m = 0.0;
  for (const sim::AxisTruth& axis : run.truth.axes) {
    longest_m = std::max(longest_m, 0.5 * (axis.range.max_m - axis.range.min_m));
  }

  for (const sim::Axis a : sim::kAxes) {
    sim::AxisTruth& axis = run.truth.axis(a);
    const double centre_m = 0.5 * (axis.range.min_m + axis.range.max_m);
    const double half_m = 0.5 * (axis.range.max_m - axis.range.min_m);
    for (std::size_t m = 0; m < sim::kMotions; ++m) {
      // Rotations get twice the number, in rad, so that at a distance of 0.5 m they displace a
      // point as much as translations.
      const double amplitude = size * (m < 3 ? 1.0 : 2.0);
      std::array<double, 3> c{};
      for (std::size_t k = 0; k < 3; ++k) {
        c[k] = amplitude * normal(random) / std::pow(2.0, static_cast<double>(k));
      }
      if (m == static_cast<std::size_t>(a)) {
        // scales are the most accurate part of a machine: 100 um/m where other errors are 250 um
        constexpr double kOfScales = 0.1;
        for (double& order : c) order *= kOfScales * half_m / longest_m;
      }
      axis.error[m] = cubic(c, centre_m, half_m);
    }
  }

  const Vector3 squareness = 2.0 * size * normal3(random);
  run.truth.squareness = {squareness.x(), squareness.y(), squareness.z()};
}

std::vector<int> shuffled(std::mt19937_64& random, std::size_t count) {
  std::vector<int> order;
  for (std::size_t i = 0; i < count; ++i) {
    order.insert(order.begin() + static_cast<std::ptrdiff_t>(random() % (i + 1)),
                 static_cast<int>(i) + 1);
  }
  return order;
}

std::vector<Vector3> ball_centres(const EvemuRun& run) {
  std::vector<Vector3> centres;
  for (const Isometry3d& T : run.T_machine_array) {
    for (const sim::ArrayBall& ball : run.array.balls) {
      centres.emplace_back(T * ball.centre_m);
    }
  }
  return centres;
}

void set_ranges(EvemuRun& run) {
  const calib::ReadingBox box = calib::bounding_box(ball_centres(run));
  constexpr double kBeyond_m = 0.02;
  for (const sim::Axis a : sim::kAxes) {
    const auto k = static_cast<Eigen::Index>(a);
    const double half_m = box.half_width_m(k) + kBeyond_m;
    run.truth.axis(a).range = {box.centre_m(k) - half_m, box.centre_m(k) + half_m, box.centre_m(k)};
  }
}

/// The calibrator with the dimensions of `array` and the uncertainties of `state`, as a calibration
/// of the array would state them; the true array (sim::true_array()) differs from it.
evemu::Calibrator as_stated(const sim::BallArray& array, const sim::ArrayState& state) {
  evemu::Calibrator c;
  c.name = array.name;
  c.tip_radius_m = array.tip_radius_m;
  for (std::size_t i = 0; i < array.balls.size(); ++i) {
    c.balls.push_back({static_cast<int>(i) + 1, array.balls[i].centre_m, array.balls[i].radius_m,
                       state.u_ball_m});
  }
  for (std::size_t i = 0; i < array.faces.size(); ++i) {
    c.blocks.push_back({static_cast<int>(i) + 1, array.faces[i].normal, state.u_block_rad});
  }
  c.expansivity = {state.alpha_per_K, state.u_alpha_per_K};
  return c;
}

/// Normals of the touches on a ball: from above and from the sides, in the array's frame.
std::vector<Vector3> on_a_ball(std::size_t points) {
  std::vector<Vector3> normals{Vector3::UnitZ()};
  for (std::size_t i = 1; i < points; ++i) {
    const double polar = i % 2 == 0 ? 0.25 * M_PI : 0.47 * M_PI;
    const double around = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(points - 1);
    normals.emplace_back(std::sin(polar) * std::cos(around), std::sin(polar) * std::sin(around),
                         std::cos(polar));
  }
  return normals;
}

/// One planned touch: a point and a normal in the array's frame.
struct Aim {
  evemu::Feature feature;
  int number;
  Vector3 centre_m;  ///< of the tip at contact
  Vector3 normal;
};

std::vector<Aim> aims_of(const EvemuRun& run) {
  std::vector<Aim> aims;
  const auto ball = [&](std::size_t i) {
    const sim::ArrayBall& b = run.array.balls[i];
    for (const Vector3& n : on_a_ball(run.points_per_ball)) {
      aims.push_back({evemu::Feature::Ball, static_cast<int>(i) + 1,
                      b.centre_m + (b.radius_m + run.array.tip_radius_m) * n, n});
    }
  };

  ball(0);
  for (std::size_t f = 0; f < 2; ++f) {
    const sim::ArrayFace& face = run.array.faces[f];
    const Vector3 n = face.normal.normalized(), x = n.unitOrthogonal(), y = n.cross(x);
    for (std::size_t i = 0; i < run.points_per_face; ++i) {
      const double around =
          2.0 * M_PI * static_cast<double>(i) / static_cast<double>(run.points_per_face);
      const double out_m = i % 3 == 2 ? 6e-3 : 12e-3;
      aims.push_back({evemu::Feature::Block, static_cast<int>(f) + 1,
                      face.centre_m + run.array.tip_radius_m * n +
                          out_m * (std::cos(around) * x + std::sin(around) * y),
                      n});
    }
  }

  for (std::size_t i = 1; i < run.array.balls.size(); ++i) {
    ball(i);
  }

  return aims;
}

/// The scale reading at which the centre of the tip is at p, given the errors of the machine.
Vector3 reading_at(const EvemuRun& run, const Vector3& p_m, const Vector3& normal,
                   const TouchTime& when) {
  const Vector3 at_m = p_m - run.truth.target_offset_m;
  sim::MachineCondition condition;
  for (Eigen::Index a = 0; a < 3; ++a) {
    condition.direction[static_cast<std::size_t>(a)] = normal(a) > 0.0 ? -1 : 1;
  }
  Vector3 q = at_m;
  for (int i = 0; i < 30; ++i) {
    Vector3 V = sim::error_m(run.truth, q, condition);
    if (run.more_error_m) V += run.more_error_m(q);
    if (run.drift) V += run.drift(when, q);
    q = at_m - V;
  }
  return q;
}

/// An orthonormal basis of the displacements of the points by the six parameters of a rigid motion.
Eigen::MatrixXd rigid_basis(const std::vector<Vector3>& points_m) {
  const auto rows = 3 * std::ssize(points_m);
  Eigen::MatrixXd rigid(rows, 6);
  for (Eigen::Index i = 0; i < std::ssize(points_m); ++i) {
    rigid.block<3, 3>(3 * i, 0).setIdentity();
    rigid.block<3, 3>(3 * i, 3) = calib::rotation_effect(points_m[static_cast<std::size_t>(i)]);
  }
  return rigid.householderQr().householderQ() * Eigen::MatrixXd::Identity(rows, 6);
}

double mean_length(const Eigen::VectorXd& v) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < v.size(); i += 3) {
    sum += v.segment<3>(i).norm();
  }
  return 3.0 * sum / static_cast<double>(v.size());
}

/// A random shift that is added to all touches and changes slowly from touch to touch.
class SlowNoise {
 public:
  SlowNoise(EvemuRun& run, std::size_t touches)
      : keep_(std::exp(-4.0 / static_cast<double>(touches))), at_(normal3(run.random)) {}
  Vector3 next(EvemuRun& run) {
    at_ = keep_ * at_ + std::sqrt(1.0 - keep_ * keep_) * normal3(run.random);
    return run.slow_noise_m * at_;
  }

 private:
  double keep_;
  Vector3 at_;
};

evemu::Touch touch(EvemuRun& run, const Aim& aim, const TouchTime& when, const Vector3& shift_m) {
  const Isometry3d& T = run.T_machine_array[static_cast<std::size_t>(when.position) - 1];
  Vector3 place = aim.centre_m;
  if (run.bent) place += run.bent(when, place);
  Vector3 p = T * place, n = T.linear() * aim.normal;
  if (run.moved) {
    const Isometry3d moved = run.moved(when);
    const Vector3 ball1 = T.translation();
    p = ball1 + moved * (p - ball1);
    n = moved.linear() * n;
  }
  p += run.sigma_touch_m * normal(run.random) * n;
  return {when.position, aim.feature, aim.number, reading_at(run, p, n, when) + shift_m};
}

/// Scales the errors so that mean |V| at the balls, without rigid motion, is `mean_error_m`.
void scale_errors(EvemuRun& run, double mean_error_m) {
  const std::mt19937_64 state = run.random;
  constexpr double kUnit_m = 1e-6;
  draw_errors(run, kUnit_m);
  const std::vector<Vector3> balls = ball_centres(run);
  Eigen::VectorXd V(3 * std::ssize(balls));
  for (Eigen::Index i = 0; i < std::ssize(balls); ++i) {
    V.segment<3>(3 * i) = sim::error_m(run.truth, balls[static_cast<std::size_t>(i)]);
  }
  const Eigen::MatrixXd rigid = rigid_basis(balls);
  const Eigen::VectorXd rigid_free = V - rigid * (rigid.transpose() * V);
  run.random = state;
  draw_errors(run, kUnit_m * mean_error_m / mean_length(rigid_free));
}

/// About 250 points inside the validity volume of the model.
std::vector<Vector3> places_in(const calib::ValidityVolume& volume) {
  const calib::ReadingBox box = calib::bounding_box(volume.vertices_m());
  constexpr int kSteps = 10;
  std::vector<Vector3> found;

  for (int x = 0; x <= kSteps; ++x) {
    for (int y = 0; y <= kSteps; ++y) {
      for (int z = 0; z <= kSteps; ++z) {
        const Vector3 u = 2.0 * Vector3(x, y, z) / kSteps - Vector3::Ones();
        const Vector3 q = box.centre_m + box.half_width_m.cwiseProduct(u);
        if (volume.contains(q)) found.push_back(q);
      }
    }
  }

  return found;
}

/// Variance of each component of V at the points due to misfit.
Eigen::VectorXd misfit_variance_m2(const calib::VolumetricModel& model,
                                   const std::vector<Vector3>& points) {
  Eigen::VectorXd variance(3 * std::ssize(points));
  for (Eigen::Index i = 0; i < std::ssize(points); ++i) {
    variance.segment<3>(3 * i) =
        model.misfit_cov_V_m2(points[static_cast<std::size_t>(i)], model.tool_offsets_m().front())
            .diagonal();
  }
  return variance;
}

/// Compares the model with the truth, without the best-fit rigid motion of the difference, which
/// the touches cannot determine.
void compare(Outcome& outcome, const EvemuRun& run, const calib::VolumetricModel& model) {
  const std::vector<Vector3> points = places_in(model.validity());
  const auto rows = 3 * std::ssize(points);
  sim::TruthMachine truth_machine = run.truth;
  truth_machine.target_offset_m = run.stated_tool_offset_m;
  const calib::PolynomialModel& polynomials = *model.polynomials();
  Eigen::VectorXd truth(rows), left(rows);
  Eigen::MatrixXd B(rows, static_cast<Eigen::Index>(polynomials.design().size()));

  for (Eigen::Index i = 0; i < std::ssize(points); ++i) {
    const Vector3& q = points[static_cast<std::size_t>(i)];
    truth.segment<3>(3 * i) = sim::error_m(truth_machine, q);
    if (run.more_error_m) truth.segment<3>(3 * i) += run.more_error_m(q);
    left.segment<3>(3 * i) = model.V_at(q, run.machine.tool_offset_m) - truth.segment<3>(3 * i);
    B.middleRows<3>(3 * i) = polynomials.design().B(q);
  }

  const Eigen::MatrixXd rigid = rigid_basis(points);
  const auto without_rigid = [&](auto m) { return (m - rigid * (rigid.transpose() * m)).eval(); };
  left = without_rigid(left);
  B = without_rigid(B);
  const Eigen::VectorXd variance =
      (B * polynomials.covariance_m2()).cwiseProduct(B).rowwise().sum() +
      misfit_variance_m2(model, points);
  outcome.before_m = mean_length(without_rigid(truth));
  outcome.left_m = mean_length(left);
  outcome.u_m = mean_length(variance.cwiseMax(0.0).cwiseSqrt());
  outcome.misfit_m = std::sqrt(misfit_variance_m2(model, points).head<3>().sum());
  constexpr double kNormal975 = 1.95996;
  for (Eigen::Index i = 0; i < rows; i += 3) {
    ++outcome.places;
    outcome.below_U += left.segment<3>(i).norm() <= 2.0 * std::sqrt(variance.segment<3>(i).sum());
  }
  outcome.intervals = static_cast<std::size_t>(rows);
  outcome.covered = static_cast<std::size_t>(
      (left.array().abs() <= kNormal975 * variance.array().max(0.0).sqrt()).count());
}

}  // namespace

EvemuRun random_evemu_run(std::uint64_t seed) {
  EvemuRun run;
  run.random.seed(seed);
  std::mt19937_64& random = run.random;
  const std::string chain = kChains[random() % kChains.size()];
  run.truth.order = *sim::parse_chain(chain);
  const sim::BallArray stated = random_array(random);
  const std::size_t positions = 8 + random() % 3;
  const double x_m = uniform(random, -0.2, 0.0), y_m = uniform(random, 0.0, 0.2),
               z_m = uniform(random, 0.0, 0.1);
  const Vector3 ball1_m(x_m, y_m, z_m);
  run.array = stated;
  run.T_machine_array = random_positions(random, ball1_m, positions);
  run.order = shuffled(random, positions);
  set_ranges(run);

  // Mean error of three in four machines: 10 to 200 um; of the others up to 0.4 mm, which is 1 to
  // 2 mm at a corner.
  scale_errors(run, random() % 4 == 0 ? log_uniform(random, 0.2e-3, 0.4e-3)
                                      : log_uniform(random, 10e-6, 200e-6));
  run.points_per_ball = 9 + random() % 17;
  run.points_per_face = 6 + random() % 15;
  run.sigma_touch_m = log_uniform(random, 0.3e-6, 1.5e-6);

  // The errors of the array are drawn from the uncertainties that its calibration states.
  sim::ArrayState state{.temperature_C = uniform(random, 17.0, 26.0),
                        .alpha_per_K = 11.5e-6,
                        .u_alpha_per_K = uniform(random, 0.2e-6, 1e-6),
                        .u_ball_m = uniform(random, 0.3e-6, 1e-6),
                        .u_block_rad = uniform(random, 1e-6, 10e-6),
                        .seed = random()};
  const double u_temperature_K = uniform(random, 0.1, 0.3);
  run.calibrator = as_stated(stated, state);
  run.observe.artefact_temperature = {.temperature_K = calib::kReferenceTemperature_K +
                                                       state.temperature_C - 20.0 +
                                                       u_temperature_K * normal(random),
                                      .u_temperature_K = u_temperature_K};
  run.array = sim::true_array(stated, state);
  run.observe.positions = static_cast<int>(positions);
  run.machine = {*calib::KinematicChain::parse(chain), Vector3::Zero()};
  run.judge.accept_shape_only = true;
  run.judge.limits.max_error_m = 0.02;  // as configured for machines of low stiffness
  run.judge.limits.max_gradient = 0.5;

  return run;
}

std::vector<evemu::Touch> touches_of(EvemuRun& run) {
  const std::vector<Aim> aims = aims_of(run);
  std::vector<evemu::Touch> touches;
  for (std::size_t i = 0; i < run.order.size(); ++i) {
    SlowNoise slow(run, aims.size());
    for (std::size_t k = 0; k < aims.size(); ++k) {
      const double share = static_cast<double>(k) / static_cast<double>(aims.size());
      const TouchTime when{
          run.order[i], share,
          (static_cast<double>(i) + share) / static_cast<double>(run.order.size())};
      touches.push_back(touch(run, aims[k], when, slow.next(run)));
    }
  }

  if (run.spoil) run.spoil(touches);
  return touches;
}

Outcome identify_and_compare_evemu(EvemuRun run) {
  const auto touches = touches_of(run);
  const auto seen = evemu::observe(touches, run.calibrator, run.machine, run.observe);
  if (!seen) return refused(seen.error().text);
  const auto solution = evemu::solve(*seen);
  if (!solution) return refused(solution.error().text);
  const auto verdict = evemu::judge(*seen, *solution, nullptr, run.judge);
  if (!verdict) return refused(verdict.error().text);
  Outcome outcome;
  outcome.accepted = verdict->accepted;
  outcome.first_reason = verdict->accepted ? "" : verdict->reasons.front();
  outcome.first_cause = verdict->accepted ? "" : verdict->causes.front();
  outcome.sigma0 = 1e6 * solution->statistics.s_m;
  compare(outcome, run, solution->model);

  return outcome;
}

}  // namespace abbe::tests::never_worse
