#pragma once
/// Models of repeated runs without their runs: values drawn from the covariance of one identified
/// run. Deterministic from the seed.

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <random>

#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_run.hpp"

namespace abbe::tests::otf {

class RepeatedRuns {
 public:
  explicit RepeatedRuns(unsigned seed) : random_(seed) {
    MadeRun run = make_run({});
    run.noise.u_scale = 0.5e-6;
    run.noise.u_axis_scale = {2e-6, 2e-6, 2e-6};
    model_ = calib::otf::identify(run.samples, run.machine, run.path, run.noise, run.options)
                 ->solution.model;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(model_->covariance());
    root_ = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  }

  [[nodiscard]] const calib::VolumetricModel& model() const { return *model_; }
  [[nodiscard]] const calib::ParameterLayout& layout() const { return model_->tables()->layout(); }

  /// The model of a run of the machine, changed by `change`; its covariance times `factor`.
  [[nodiscard]] calib::VolumetricModel run(const Eigen::VectorXd& change, double factor = 1.0) {
    std::normal_distribution<double> normal;
    Eigen::VectorXd noise(root_.cols());
    for (double& value : noise) {
      value = normal(random_);
    }
    return with(model_->U() + change + std::sqrt(factor) * (root_ * noise),
                factor * model_->covariance());
  }
  [[nodiscard]] calib::VolumetricModel run() { return run(no_change()); }
  [[nodiscard]] calib::VolumetricModel with(const Eigen::VectorXd& U,
                                            const Eigen::MatrixXd& covariance) const {
    return *calib::VolumetricModel::from_vector(layout(), calib::ModelDatum::G1,
                                                model_->tool_offsets_m(), U, covariance,
                                                model_->validity());
  }

  [[nodiscard]] Eigen::VectorXd no_change() const {
    return Eigen::VectorXd::Zero(model_->U().size());
  }
  /// Changes a table by a line through the reference (straightness: a parabola), squareness by its
  /// value: by `sigmas` standard uncertainties of the difference of two runs where the change is
  /// largest.
  [[nodiscard]] Eigen::VectorXd change(const std::string& table, double sigmas) const {
    Eigen::VectorXd shape = no_change();
    for (std::size_t i = 0; i < layout().model_size(); ++i) {
      const calib::Parameter p = model_->parameters()[i];
      if (p.name == table) {
        shape(static_cast<Eigen::Index>(i)) = p.position_m ? shape_at(table, *p.position_m) : 1.0;
      }
    }
    Eigen::Index at = 0;
    const double largest = shape.cwiseAbs().maxCoeff(&at);
    return shape * (sigmas * std::sqrt(2.0 * model_->covariance()(at, at)) / largest);
  }

 private:
  [[nodiscard]] double shape_at(const std::string& table, double q_m) const {
    const calib::ErrorMotion motion = *calib::error_motion(table);
    const calib::AxisNodes& axis = model_->nodes()[calib::index(motion.axis)];
    return calib::is_straightness(motion)
               ? (q_m - axis.nodes_m.front()) * (axis.nodes_m.back() - q_m)
               : q_m - axis.reference_m;
  }

  std::mt19937_64 random_;
  std::optional<calib::VolumetricModel> model_;
  Eigen::MatrixXd root_;
};

}  // namespace abbe::tests::otf
