#pragma once
/// Finds residuals that are equal whenever a leg comes to the same place (find_misfit.hpp).

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "solve/find_misfit.hpp"

namespace abbe::calib::otf {

/// The section to which a row belongs.
struct Section {
  std::size_t index = 0;  ///< index of the section
  std::size_t cell = 0;   ///< cell to which the section belongs; the misfit has one variance for
                          ///< each cell
};

/// A division into sections and cells (of one axis, or of the volume), and the number of components
/// of the misfit in each.
struct Places {
  std::size_t sections = 0, cells = 0, components = 0;
  std::function<Section(const Observation&)> section_of;
  /// Computes the vector x of a row of the observations: `components` values.
  std::function<void(const Observations&, std::size_t row, Eigen::Ref<Eigen::VectorXd> x)> effect;
};

class RepeatedResiduals {
 public:
  RepeatedResiduals(const Places& places, std::span<const ResidualsOfRun> runs,
                    std::size_t unknowns);

  /// Variances of the misfit, components x cells, in the squared unit of the component; 0 if the
  /// residuals are not significant. `of_noise`: see find_misfit().
  [[nodiscard]] Eigen::MatrixXd variances(const Eigen::MatrixXd& of_noise) const;
  /// Effect of the misfit of each section on the unknowns: root of the covariance that the misfit
  /// adds.
  [[nodiscard]] Eigen::MatrixXd root_of_covariance(const Eigen::MatrixXd& variances,
                                                   const Eigen::MatrixXd& Q) const;
  /// Number of sections after which the correlation of a component's values falls to one half.
  [[nodiscard]] double length_in_sections(const Eigen::MatrixXd& variances,
                                          std::size_t component) const;

 private:
  /// Sums over the rows of a leg in one section. Few columns of B are not zero.
  struct OfLeg {
    std::size_t leg = 0;  ///< index in legs_
    Eigen::VectorXd b;
    Eigen::MatrixXd n;
    std::vector<std::size_t> unknowns;   ///< unknowns to which the columns of B belong
    std::vector<double> B;               ///< values of B, column by column
    std::vector<std::size_t> column_of;  ///< by unknown: number of its column from 1; 0: no column

    /// The column of B that belongs to an unknown; it is added if it does not exist.
    [[nodiscard]] double* column(std::size_t unknown);
  };
  struct Leg {
    std::size_t run = 0;
    double time = 0.0;  ///< mean time of its rows
    double far = 0.0;   ///< least difference in time for a leg to be independent
  };
  [[nodiscard]] bool are_independent(const OfLeg& a, const OfLeg& b) const;
  /// The product C B^T: unknowns x components.
  [[nodiscard]] static Eigen::MatrixXd times(const Eigen::MatrixXd& C, const OfLeg& leg);
  /// Diagonal of B C B^T, where both B belong to different legs. `CB`: times() of the first leg.
  [[nodiscard]] static Eigen::VectorXd with_other(const Eigen::MatrixXd& CB, const OfLeg& other);
  void add_run(const Places& places, const ResidualsOfRun& run, std::size_t number,
               std::size_t unknowns);

  std::size_t components_ = 0, cells_ = 0;
  std::vector<Leg> legs_;
  std::vector<std::vector<OfLeg>> sections_;
  std::vector<std::size_t> cell_of_;  ///< cell of each section
};

}  // namespace abbe::calib::otf
