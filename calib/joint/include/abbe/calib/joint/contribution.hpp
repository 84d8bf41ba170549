#pragma once
/// What each part contributes to a joint model (identify.hpp), as standard uncertainties.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/joint/identify.hpp"

namespace abbe::calib::joint {

/// rms of the standard uncertainty of V over the nodes, rigid motion removed (as u_m of
/// otf::correction_size). nullopt: the parts do not determine the tables.
struct Contribution {
  std::optional<double> u_alone_m;    ///< of the model of this part alone
  std::optional<double> u_without_m;  ///< of the model of all other parts
};
/// One per part, in their order.
[[nodiscard]] Result<std::vector<Contribution>> contributions(std::span<const Part>,
                                                              const CommonTables&);

/// Root mean square of the standard uncertainties of the nodes of a table; of a squareness error,
/// its standard uncertainty. In datum G2 of the model.
struct TableUncertainty {
  std::string table;      ///< "EXX", "EC0Y"
  bool is_angle = false;  ///< rad, else m
  double u = 0.0;
};
/// Of a model of tables, in the order of its parameters.
[[nodiscard]] std::vector<TableUncertainty> table_uncertainties(const VolumetricModel&);

}  // namespace abbe::calib::joint
