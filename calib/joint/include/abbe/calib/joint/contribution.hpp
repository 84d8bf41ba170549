#pragma once
/// Standard uncertainties that show the contribution of each part to a joint model (identify.hpp).

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/joint/identify.hpp"

namespace abbe::calib::joint {

/// Contribution of one part to a joint model (identify.hpp), as rms of the standard uncertainty of
/// V over the nodes, rigid motion removed (u_m of otf::correction_size). nullopt: the parts do not
/// determine the tables.
struct Contribution {
  std::optional<double> u_alone_m;    ///< for the model of this part alone
  std::optional<double> u_without_m;  ///< for the model of all other parts
};
/// Returns one contribution per part, in the order of the parts.
[[nodiscard]] Result<std::vector<Contribution>> contributions(std::span<const Part>,
                                                              const CommonTables&);

/// Uncertainty of a table in datum G2: root mean square of the standard uncertainties of its nodes.
/// For a squareness error its standard uncertainty.
struct TableUncertainty {
  std::string table;      ///< such as "EXX", "EC0Y"
  bool is_angle = false;  ///< true: u in rad, false: in m
  double u = 0.0;
};
/// Uncertainties of all tables and squareness errors of a model, in the order of its parameters.
[[nodiscard]] std::vector<TableUncertainty> table_uncertainties(const VolumetricModel&);

}  // namespace abbe::calib::joint
