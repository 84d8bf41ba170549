#pragma once
/// Residuals that repeat at a place whenever a leg comes there (find_misfit.hpp).

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "solve/find_misfit.hpp"

namespace abbe::calib::otf {

/// The place of a row.
struct Section {
  std::size_t index = 0;  ///< of the place
  std::size_t cell = 0;   ///< to which the place belongs; misfit has one variance for each cell
};

/// Places of a kind, and the components of the misfit there.
struct Places {
  std::size_t sections = 0, cells = 0, components = 0;
  std::function<Section(const Observation&)> section_of;
  /// x of a row of the observations: `components` values.
  std::function<void(const Observations&, std::size_t row, Eigen::Ref<Eigen::VectorXd> x)> effect;
};

class RepeatedResiduals {
 public:
  RepeatedResiduals(const Places& places, std::span<const ResidualsOfRun> runs,
                    std::size_t unknowns);

  /// Variances of the misfit, components x cells, in the square of the unit of the component; 0
  /// where chance explains the residuals. `of_noise`: see find_misfit().
  [[nodiscard]] Eigen::MatrixXd variances(const Eigen::MatrixXd& of_noise) const;
  /// Effect of the misfit of each section on the unknowns: root of the covariance that it adds.
  [[nodiscard]] Eigen::MatrixXd root_of_covariance(const Eigen::MatrixXd& variances,
                                                   const Eigen::MatrixXd& Q) const;
  /// Number of sections over which the values of a component stay alike: their correlation falls to
  /// one half.
  [[nodiscard]] double length_in_sections(const Eigen::MatrixXd& variances,
                                          std::size_t component) const;

 private:
  /// Sums over the rows of a leg in a section. B has few columns that are not zero.
  struct OfLeg {
    std::size_t leg = 0;  ///< index in legs_
    Eigen::VectorXd b;
    Eigen::MatrixXd n;
    std::vector<std::size_t> unknowns;   ///< of the columns of B
    std::vector<double> B;               ///< column by column
    std::vector<std::size_t> column_of;  ///< by unknown, from 1; 0: none

    /// The column of B of an unknown, which is added if it does not exist.
    [[nodiscard]] double* column(std::size_t unknown);
  };
  struct Leg {
    std::size_t run = 0;
    double time = 0.0;  ///< mean of its rows
    double far = 0.0;   ///< least difference in time to an independent leg
  };
  [[nodiscard]] bool are_independent(const OfLeg& a, const OfLeg& b) const;
  /// C B^T: unknowns x components.
  [[nodiscard]] static Eigen::MatrixXd times(const Eigen::MatrixXd& C, const OfLeg& leg);
  /// The diagonal of B C B^T for the B of two legs, `CB`: times() of the first.
  [[nodiscard]] static Eigen::VectorXd with_other(const Eigen::MatrixXd& CB, const OfLeg& other);
  void add_run(const Places& places, const ResidualsOfRun& run, std::size_t number,
               std::size_t unknowns);

  std::size_t components_ = 0, cells_ = 0;
  std::vector<Leg> legs_;
  std::vector<std::vector<OfLeg>> sections_;
  std::vector<std::size_t> cell_of_;  ///< by section
};

}  // namespace abbe::calib::otf
