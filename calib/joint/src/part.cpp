#include "abbe/calib/joint/part.hpp"

#include <algorithm>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/model/datum_coordinates.hpp"

namespace abbe::calib::joint {

Result<CommonTables> tables_of(const VolumetricModel& model) {
  const auto not_applicable = [](const std::string& reason) {
    return failure(ErrorCode::NotApplicable, "joint identification: the model " + reason);
  };
  const TableBasis* tables = model.tables();
  if (tables == nullptr) {
    return not_applicable("has polynomials, must have tables");
  }
  if (!is_of_tables(model.datum())) {
    return not_applicable("is not in datum G1 or G2");
  }
  if (model.tool_offsets_m().size() != 1) {
    return not_applicable(
        message("has ", model.tool_offsets_m().size(), " tool offsets, must have one"));
  }
  if (model.travel() != nullptr) {
    return not_applicable(
        "depends on the direction of travel, which the common tables do not: identify the runs "
        "without backlash");
  }
  if (!is_in_datum(datum_coordinates(*tables), model.covariance())) {
    return not_applicable(
        "has half its backlash in the covariance, which does not average out over "
        "parts: identify the runs without backlash");
  }
  return CommonTables{*tables, model.tool_offsets_m().front()};
}

}  // namespace abbe::calib::joint
