#include "read_misfit.hpp"

namespace abbe::daemon {

std::optional<calib::Misfit> read_misfit(ModelReader& in) {
  const std::string path = "misfit";
  if (!in.root().is_object() || !in.root().contains(path)) return std::nullopt;
  const ModelJson& stored = in.root().at(path);
  calib::Misfit misfit;
  if (const ModelJson* list = in.find(stored, path, "u_of_parameters")) {
    const auto values = in.numbers(*list, path + ".u_of_parameters", kMicroUnit);
    misfit.u_of_parameters =
        Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  }
  if (const ModelJson* list = in.find(stored, path, "u_V_um")) {
    const auto values = in.numbers(*list, path + ".u_V_um", kMicroUnit);
    if (values.size() == 3)
      misfit.u_V_m = {values[0], values[1], values[2]};
    else
      in.fault(path + ".u_V_um", fmt::format("{} values, expected 3", values.size()));
  }
  misfit.table_length_m = in.number_of(stored, path, "table_length_mm", kMm);
  misfit.V_length_m = in.number_of(stored, path, "V_length_mm", kMm);
  return misfit;
}

}  // namespace abbe::daemon
