#include "abbe/calib/otf/live/running_estimate.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <span>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/estimation/null_space.hpp"
#include "abbe/calib/model/model_datum.hpp"
#include "abbe/calib/otf/solve/backlash.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::otf {
namespace {

constexpr double kLargestSecondOrder_m = 0.1e-6;

/// Standard deviation of the prior of an unknown, m or rad. The prior of the rigid unknowns is ten
/// times wider, because the pose from three vertices may have larger errors than the machine.
constexpr double kPrior = 1e-3, kRigidPrior = 10.0 * kPrior;
constexpr double kLargestU = 0.05 * kPrior;

/// Weight of the datum conditions: they are satisfied within 1 nm and 1 nrad.
constexpr double kDatumWeight = 1e9;

/// Share of an unknown in a null space: squared entry of a unit vector. Larger shares are not
/// rounding, which is below 1e-16.
constexpr double kRoundingShare = 1e-8;

/// Least width of the pairs across their longest direction, relative to their length. Narrower
/// pairs do not determine the rotation about this direction.
constexpr double kLeastWidth = 0.1;

bool span_a_plane(std::span<const Vector3> points_m) {
  if (points_m.size() < 3) {
    return false;
  }

  Vector3 mean = Vector3::Zero();
  for (const Vector3& p : points_m) {
    mean += p / static_cast<double>(points_m.size());
  }
  Matrix3 scatter = Matrix3::Zero();
  for (const Vector3& p : points_m) {
    scatter += (p - mean) * (p - mean).transpose();
  }
  const Vector3 squares = Eigen::SelfAdjointEigenSolver<Matrix3>(scatter).eigenvalues();

  return squares(2) > 0.0 && squares(1) > kLeastWidth * kLeastWidth * squares(2);
}

estimation::Information with_datum(estimation::Information data, const Eigen::MatrixXd& K) {
  data.add_rows(kDatumWeight * K, Eigen::VectorXd::Zero(K.rows()));
  return data;
}

struct Estimate {
  Eigen::VectorXd U, u;
};

/// Adds the prior N(0, prior^2) of every unknown and solves the triangular system.
Estimate regular_estimate(estimation::Information all, const Eigen::VectorXd& prior) {
  for (Eigen::Index i = 0; i < prior.size(); ++i) {
    all.add_prior(static_cast<std::size_t>(i), 0.0, prior(i));
  }
  const Eigen::MatrixXd R = all.R();
  const auto triangle = R.triangularView<Eigen::Upper>();
  const Eigen::MatrixXd inverse = triangle.solve(Eigen::MatrixXd::Identity(R.rows(), R.cols()));
  return {.U = triangle.solve(all.z()), .u = inverse.rowwise().norm()};
}

double per_dof(double chi2, std::ptrdiff_t dof) {
  return dof > 0 ? chi2 / static_cast<double>(dof) : 1.0;
}

double factor_of(const estimation::Information& data, const Eigen::VectorXd& U, std::size_t rank,
                 const MomentAccumulator::WithinCells& within) {
  const double chi2 = data.rest() + (data.R() * U - data.z()).squaredNorm();
  const auto dof = static_cast<std::ptrdiff_t>(data.rows()) - static_cast<std::ptrdiff_t>(rank);
  const double between =
      per_dof(chi2 - within.chi2, dof - static_cast<std::ptrdiff_t>(within.rows));
  return std::max({1.0, per_dof(chi2, dof), between});
}

/// Effect of an uncertain scale on a node of a table. A relative change s of all ranges, or of the
/// scale of an axis, changes the positioning tables by s (q - reference). This satisfies the datum;
/// the rest of the change is a rigid motion.
double scale_effect(const ErrorMotion& motion, const AxisNodes& nodes, std::size_t node,
                    const Noise& noise) {
  if (!is_positioning(motion)) {
    return 0.0;
  }
  return (nodes.nodes_m[node] - nodes.reference_m) *
         root_sum_of_squares(noise.u_scale, noise.u_axis_scale[index(motion.axis)]);
}

}  // namespace

std::size_t TableSoFar::determined_nodes() const {
  return static_cast<std::size_t>(std::count_if(
      nodes.begin(), nodes.end(), [](const NodeSoFar& node) { return node.determined; }));
}

Result<RunningEstimate> RunningEstimate::of(Setup setup) {
  auto layout =
      ParameterLayout::observable_with_one_target(setup.machine.chain, setup.machine.nodes);
  ABBE_TRY(layout);
  auto basis = TableBasis::of(*std::move(layout), {.travel = setup.backlash});
  ABBE_TRY(basis);

  RunningEstimate estimate(std::move(setup), *std::move(basis));
  // The noise is checked here, so that an error is not reported only at the first pose.
  auto moments = MomentAccumulator::of({.basis = estimate.basis_, .noise = estimate.setup_.noise});
  ABBE_TRY(moments);
  return estimate;
}

void RunningEstimate::add_pair(const Vector3& q_m, const Vector3& p_tracker_m) {
  at_m_.push_back(q_m + setup_.machine.target_offset_m);
  seen_m_.push_back(p_tracker_m);
}

bool RunningEstimate::update_pose() {
  if (corrected_ || !span_a_plane(at_m_)) {
    return false;
  }
  const auto T = fit_rigid(seen_m_, at_m_);
  return T && take_if_better(*T);
}

bool RunningEstimate::correct_pose(const TablesSoFar& tables) {
  if (!tables.rigid || !has_pose()) {
    return false;
  }
  corrected_ = true;
  const Vector3 T_m = tables.rigid->head<3>(), r = tables.rigid->tail<3>();
  const Matrix3 back = r.norm() > 0.0
                           ? Eigen::AngleAxisd(-r.norm(), r.normalized()).toRotationMatrix()
                           : Matrix3(Matrix3::Identity());
  const RigidTransform& used = T_machine_tracker_;
  return take_if_better({back * used.R, back * (used.t_m - T_m)});
}

bool RunningEstimate::take_if_better(const RigidTransform& T) {
  return second_order_m(T).value_or(2.0 * kLargestSecondOrder_m) > kLargestSecondOrder_m && use(T);
}

/// Terms of second order between T and the present pose; nullopt: there is no pose yet.
std::optional<double> RunningEstimate::second_order_m(const RigidTransform& T) const {
  if (!moments_) {
    return std::nullopt;
  }

  const double phi = Eigen::AngleAxisd(T.R * T_machine_tracker_.R.transpose()).angle();
  double largest_m = 0.0, extent_m = 0.0;
  for (const Vector3& p : seen_m_) {
    largest_m = std::max(largest_m, (T * p - T_machine_tracker_ * p).norm());
    extent_m = std::max(extent_m, (p - seen_m_.front()).norm());
  }
  return 0.5 * phi * phi * extent_m + phi * largest_m;
}

bool RunningEstimate::use(const RigidTransform& T) {
  T_machine_tracker_ = T;
  moments_ = *MomentAccumulator::of({.basis = basis_,
                                     .target_offset_m = setup_.machine.target_offset_m,
                                     .T_machine_tracker = T,
                                     .noise = setup_.noise,
                                     .corner_m = setup_.corner_m,
                                     .range_offset = setup_.noise.u_range_offset_m > 0.0});
  travel_ = {};
  return true;
}

void RunningEstimate::begin_leg(const Vector3& from_m, const Vector3& to_m) {
  if (moments_ && from_m != to_m) {
    moments_->begin_leg(from_m, to_m);
    travel_ = travel_after(travel_, to_m - from_m);
  }
}

void RunningEstimate::add(const Vector3& p_tracker_m) {
  if (moments_ && knows_travel()) {
    moments_->add(p_tracker_m);
  }
}

bool RunningEstimate::knows_travel() const {
  return setup_.backlash == TravelDependence::None ||
         std::count(travel_.begin(), travel_.end(), Travel::Unknown) == 0;
}

/// Half the difference between the directions of travel at a node; 0 without backlash.
double RunningEstimate::half_difference(std::size_t table, std::size_t node,
                                        const Eigen::VectorXd& U) const {
  const ParameterLayout& layout = basis_.layout();
  switch (basis_.travel()) {
    case TravelDependence::None:
      return 0.0;
    case TravelDependence::Backlash:
      return 0.5 * U(static_cast<Eigen::Index>(layout.model_size() + table));
    case TravelDependence::Tables:  // the order of D is that of the nodes
      return 0.5 * U(static_cast<Eigen::Index>(layout.model_size() + layout.tables()[table].offset +
                                               node));
  }
  return 0.0;
}

void RunningEstimate::set_scale(double u_scale, const std::array<double, 3>& u_axis_scale) {
  setup_.noise.u_scale = u_scale;
  setup_.noise.u_axis_scale = u_axis_scale;
}

Result<TablesSoFar> RunningEstimate::tables() const {
  if (!moments_) {
    return failure(ErrorCode::TooFewObservations,
                   message("tables of the run: the vertices reached so far (", at_m_.size(),
                           ") do not span a plane"));
  }

  estimation::Information data = moments_->information();
  if (const double u_m = setup_.noise.u_range_offset_m; u_m > 0.0) {
    data.add_prior(data.unknowns() - 1, 0.0, u_m);
  }

  const ParameterLayout& layout = basis_.layout();
  for (std::size_t i = layout.model_size(); i < basis_.size(); ++i) {
    data.add_prior(i, 0.0, kUOfBacklash);
  }
  const auto rigid_at = static_cast<Eigen::Index>(basis_.size());
  Eigen::VectorXd prior =
      Eigen::VectorXd::Constant(static_cast<Eigen::Index>(data.unknowns()), kPrior);
  prior.segment<kRigidUnknowns>(rigid_at).setConstant(kRigidPrior);

  const Eigen::MatrixXd K = datum_conditions(ModelDatum::G2, basis_, data.unknowns());
  const estimation::Information in_datum = with_datum(data, K);
  const estimation::NullSpace unseen = estimation::null_space(in_datum);
  const Estimate estimate = regular_estimate(in_datum, prior);

  TablesSoFar result;
  result.samples = moments_->samples();
  const std::size_t conditions = std::min(unseen.rank, static_cast<std::size_t>(K.rows()));
  result.variance_factor =
      factor_of(data, estimate.U, unseen.rank - conditions, moments_->within_cells());

  const auto node = [&](std::size_t unknown, double further_u) {
    const auto i = static_cast<Eigen::Index>(unknown);
    const double u =
        root_sum_of_squares(std::sqrt(result.variance_factor) * estimate.u(i), further_u);
    const bool determined = unseen.share(i) < kRoundingShare && u < kLargestU;
    return determined ? NodeSoFar{estimate.U(i), u, true} : NodeSoFar{};
  };

  for (std::size_t t = 0; t < layout.tables().size(); ++t) {
    const Table& table = layout.tables()[t];
    TableSoFar& out = result.tables.emplace_back(TableSoFar{.motion = table.motion, .nodes = {}});
    const AxisNodes& nodes = layout.nodes()[index(table.motion.axis)];
    for (std::size_t i = 0; i < nodes.nodes_m.size(); ++i) {
      out.nodes.push_back(node(
          table.offset + i, root_sum_of_squares(scale_effect(table.motion, nodes, i, setup_.noise),
                                                half_difference(t, i, estimate.U))));
    }
  }
  for (std::size_t i = 0; i < result.squareness.size(); ++i) {
    result.squareness[i] = node(layout.squareness_offset() + i, 0.0);
  }
  if (unseen.share.segment<kRigidUnknowns>(rigid_at).maxCoeff() < kRoundingShare) {
    result.rigid = estimate.U.segment<kRigidUnknowns>(rigid_at);
  }

  return result;
}

}  // namespace abbe::calib::otf
