#include "abbe/sim/touching.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "abbe/sim/noise.hpp"
#include "crossing.hpp"

namespace abbe::sim {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kAbove_m = 10e-3;      // clearance of travelling moves above a feature
constexpr double kStrayAway_m = 40e-3;  // larger than every tolerance

/// A direction on a spiral from the pole to the equator: successive points are close together, and
/// their density is uniform.
Vector3d direction_on_ball(std::size_t point, std::size_t points) {
  const double golden_rad = std::numbers::pi * (3.0 - std::sqrt(5.0));
  const double z =
      1.0 - static_cast<double>(point) / static_cast<double>(std::max<std::size_t>(points - 1, 1));
  const double across = std::sqrt(1.0 - z * z);
  const double angle_rad = golden_rad * static_cast<double>(point);
  return {across * std::cos(angle_rad), across * std::sin(angle_rad), z};
}

/// A point in rows of alternating direction; the points are divided evenly among the rows.
Vector3d place_on_face(const ArrayFace& face, std::size_t point, std::size_t points) {
  const auto rows = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(points))));
  const std::size_t columns = (points + rows - 1) / rows;
  const std::size_t row = point / columns, in_row = std::min(columns, points - row * columns);
  const auto from_middle = [](std::size_t i, std::size_t n) {
    return n < 2 ? 0.0 : 2.0 * static_cast<double>(i) / static_cast<double>(n - 1) - 1.0;
  };
  const std::size_t column = row % 2 == 0 ? point % columns : in_row - 1 - point % columns;
  return face.centre_m + from_middle(row, rows) * face.half_1_m +
         from_middle(column, in_row) * face.half_2_m;
}

/// Builds the path and the list of its probing moves.
class Planner {
 public:
  Planner(const TruthMachine& truth, const BallArray& array, const TouchingOptions& options)
      : truth_(truth), array_(array), options_(options) {
    program_.path.feed_m_per_s = options.travel_m_per_s;
    program_.path.acceleration_m_per_s2 = options.acceleration_m_per_s2;
    program_.path.vertices.push_back({});  // reading 0, at which the counters are set up
  }

  void ball(const Isometry3d& T_machine_array, const ArrayBall& ball) {
    const Vector3d centre_m = T_machine_array * ball.centre_m;
    const Vector3d up = T_machine_array.linear() * Vector3d::UnitZ();
    const Vector3d above_m = centre_m + (ball.radius_m + array_.tip_radius_m + kAbove_m) * up;
    drive_to(above_m);

    for (std::size_t i = 0; i < options_.points_per_ball; ++i) {
      const Vector3d normal =
          T_machine_array.linear() * direction_on_ball(i, options_.points_per_ball);
      touch({.place_m = centre_m + ball.radius_m * normal,
             .normal = normal,
             .centre_m = centre_m,
             .radius_m = ball.radius_m});
    }

    drive_to(above_m);
  }

  void face(const Isometry3d& T_machine_array, const ArrayFace& face) {
    const Vector3d normal = T_machine_array.linear() * face.normal;
    const Vector3d away_m =
        T_machine_array * face.centre_m + (array_.tip_radius_m + kAbove_m) * normal;
    drive_to(away_m);
    for (std::size_t i = 0; i < options_.points_per_block; ++i) {
      touch({.place_m = T_machine_array * place_on_face(face, i, options_.points_per_block),
             .normal = normal});
    }
    drive_to(away_m);
  }

  [[nodiscard]] TouchingProgram take() { return std::move(program_); }

 private:
  void touch(ProbingMove move) {
    const std::size_t number = touches_++;
    if (options_.stray.contains(number)) {
      ProbingMove stray = move;
      stray.kind = ProbingMove::Kind::InTheAir;
      stray.place_m += kStrayAway_m * move.normal;
      probe(stray);
    }
    if (options_.missed.contains(number)) move.kind = ProbingMove::Kind::Silent;
    probe(move);
    if (options_.doubled.contains(number)) probe(move);
  }

  void probe(ProbingMove move) {
    const Vector3d contact_m = move.place_m + array_.tip_radius_m * move.normal;
    const Vector3d before_m = contact_m + options_.approach_m * move.normal;
    drive_to(before_m);
    drive_to(contact_m - options_.beyond_m * move.normal, options_.probing_m_per_s);
    move.leg = program_.path.vertices.size() - 2;  // the leg that ends at the last vertex
    program_.moves.push_back(move);
    drive_to(before_m, options_.retract_m_per_s);
  }

  /// Adds a leg to `place_m`; no leg if the machine is already there. Feed 0: the travel feed.
  void drive_to(const Vector3d& place_m, double feed_m_per_s = 0.0) {
    const Vector3d q_m = reading_at_m(truth_, place_m);
    auto& vertices = program_.path.vertices;
    if (!vertices.empty() && vertices.back().q_m == q_m) return;
    vertices.push_back({q_m, feed_m_per_s});
  }

  const TruthMachine& truth_;
  const BallArray& array_;
  const TouchingOptions& options_;
  TouchingProgram program_;
  std::size_t touches_ = 0;
};

/// Distance between the surfaces of tip and feature.
double clearance_m(const ProbingMove& move, const Vector3d& tip_m, double tip_radius_m) {
  if (move.radius_m > 0.0) return (tip_m - move.centre_m).norm() - move.radius_m - tip_radius_m;
  return (tip_m - move.place_m).dot(move.normal) - tip_radius_m;
}

double contact_s(const ProbingMove& move, const TruthMachine& truth, const PathMotion& path,
                 double tip_radius_m) {
  const double before = path.leg_begin_s(move.leg);
  const double after = path.leg_end_s(move.leg);
  if (move.kind == ProbingMove::Kind::InTheAir) return 0.5 * (before + after);
  return crossing(before, after, [&](double t) {
    return clearance_m(move, position_m(truth, path.at(t).q_m), tip_radius_m) <= 0.0;
  });
}

}  // namespace

Vector3d reading_at_m(const TruthMachine& truth, const Vector3d& place_m) {
  constexpr int kMostSteps = 200;  // about twenty steps are enough for slopes of V near 0.2
  // A step below this ends the iteration. The step seldom becomes exactly 0, because the last bit
  // alternates.
  constexpr double kNothing_m = 1e-14;
  Vector3d q_m = place_m;
  for (int i = 0; i < kMostSteps; ++i) {
    const Vector3d step_m = place_m - position_m(truth, q_m);
    q_m += step_m;
    if (step_m.squaredNorm() < kNothing_m * kNothing_m) break;
  }
  return q_m;
}

TouchingProgram plan_touching(const TruthMachine& truth, const BallArray& array,
                              const TouchingOptions& options) {
  const auto positions = reference_positions();
  Planner planner(truth, array, options);
  for (const int number : options.positions) {
    const Isometry3d& T_machine_array = positions.at(static_cast<std::size_t>(number) - 1);
    planner.ball(T_machine_array, array.balls.front());
    for (const ArrayFace& face : array.faces) planner.face(T_machine_array, face);
    for (std::size_t i = 1; i < array.balls.size(); ++i)
      planner.ball(T_machine_array, array.balls[i]);
  }
  return planner.take();
}

std::vector<double> edge_times_s(const TouchingProgram& program, const TruthMachine& truth,
                                 const PathMotion& path, double tip_radius_m,
                                 const TouchingOptions& options) {
  std::vector<double> edges;
  for (std::size_t i = 0; i < program.moves.size(); ++i) {
    const ProbingMove& move = program.moves[i];
    if (move.kind == ProbingMove::Kind::Silent) continue;
    const double late_s = options.noise_m / options.probing_m_per_s *
                              gaussian(options.seed, NoiseStream::Probe, 2 * i) +
                          options.jitter_s * gaussian(options.seed, NoiseStream::Probe, 2 * i + 1);
    edges.push_back(contact_s(move, truth, path, tip_radius_m) + late_s + options.delay_s);
  }
  return edges;
}

}  // namespace abbe::sim
