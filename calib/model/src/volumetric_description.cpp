// The stored form of VolumetricModel: names of the parameters, description, and back.
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib {
namespace {

/// The tables to which the stored parameters belong, in the order of the parameters.
std::vector<ErrorMotion> tables_named(std::span<const Parameter> parameters) {
  std::vector<ErrorMotion> found;
  for (const Parameter& p : parameters) {
    const std::optional<ErrorMotion> e = error_motion(p.name);
    if (e && (found.empty() || !(found.back() == *e))) {
      found.push_back(*e);
    }
  }
  return found;
}

/// Stored node positions that differ by less than this are the same node: files contain decimal
/// numbers in mm, so that positions differ by rounding.
constexpr double kSameNode_m = 1e-9;

constexpr double kNoPosition_m = std::numeric_limits<double>::quiet_NaN();

Result<void> check_parameters(const std::vector<Parameter>& stored,
                              const std::vector<Parameter>& expected) {
  if (stored.size() != expected.size()) {
    return failure(
        ErrorCode::BadInput,
        message("model: ", stored.size(), " parameters; tables and nodes need ", expected.size()));
  }

  for (std::size_t i = 0; i < stored.size(); ++i) {
    const Parameter &actual = stored[i], &wanted = expected[i];
    const bool same_node =
        actual.position_m.has_value() == wanted.position_m.has_value() &&
        (!actual.position_m || std::abs(*actual.position_m - *wanted.position_m) < kSameNode_m);
    if (actual.name != wanted.name || !same_node) {
      return failure(ErrorCode::BadInput,
                     message("model: parameter ", i, " is ", actual.name, " at ",
                             actual.position_m.value_or(kNoPosition_m), " m, should be ",
                             wanted.name, " at ", wanted.position_m.value_or(kNoPosition_m), " m"));
    }
    if (!std::isfinite(actual.value)) {
      return failure(ErrorCode::NotFinite,
                     message("model: parameter ", i, " (", actual.name, ") is not a number"));
    }
  }

  return {};
}

std::vector<Parameter> named(const PolynomialModel& model) {
  std::vector<Parameter> parameters;
  for (std::size_t j = 0; j < model.design().size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    parameters.push_back({model.design().equivalent().names()[j], std::nullopt, model.c_m()(i),
                          std::sqrt(model.covariance_m2()(i, i))});
  }
  return parameters;
}

Result<void> check_names(const std::vector<Parameter>& stored,
                         std::span<const std::string> expected) {
  if (stored.size() != expected.size()) {
    return failure(
        ErrorCode::BadInput,
        message("model: ", stored.size(), " coefficients; the order needs ", expected.size()));
  }
  for (std::size_t i = 0; i < stored.size(); ++i) {
    if (stored[i].name != expected[i]) {
      return failure(ErrorCode::BadInput, message("model: coefficient ", i, " is ", stored[i].name,
                                                  ", should be ", expected[i]));
    }
  }
  return {};
}

std::vector<Parameter> named(const ParameterLayout& layout, const Eigen::VectorXd& U,
                             const Eigen::MatrixXd& C) {
  std::vector<Parameter> parameters;
  const auto add = [&](std::string parameter_name, std::optional<double> position_m) {
    const auto i = static_cast<Eigen::Index>(parameters.size());
    parameters.push_back({std::move(parameter_name), position_m, U(i), std::sqrt(C(i, i))});
  };

  for (const Table& table : layout.tables()) {
    for (const double node_m : layout.nodes()[index(table.motion.axis)].nodes_m) {
      add(name(table.motion), node_m);
    }
  }

  for (const std::string_view squareness : kSquarenessNames) {
    add(std::string(squareness), std::nullopt);
  }

  return parameters;
}

Result<VolumetricModel> polynomials_from(const ModelDescription& d) {
  Result<ScaledDesign> design = ScaledDesign::of(d.chain, d.polynomials->order, d.polynomials->box);
  if (!design) {
    return failure(design.error().code, message("model: ", design.error().text));
  }

  ABBE_TRY(check_names(d.parameters, design->equivalent().names()));

  if (d.tool_offsets_m.size() != 1) {
    return failure(ErrorCode::BadInput,
                   message("model: ", d.tool_offsets_m.size(),
                           " tool offsets; polynomials are valid for exactly one"));
  }

  Eigen::VectorXd c_m(static_cast<Eigen::Index>(d.parameters.size()));
  for (std::size_t i = 0; i < d.parameters.size(); ++i) {
    c_m(static_cast<Eigen::Index>(i)) = d.parameters[i].value;
  }

  Result<ValidityVolume> validity = ValidityVolume::of_vertices(d.validity_hull_m);
  ABBE_TRY(validity);

  return PolynomialModel::of(*std::move(design), d.polynomials->ball1_m, std::move(c_m),
                             d.covariance)
      .and_then([&](PolynomialModel model) {
        return VolumetricModel::from_polynomials(std::move(model), d.datum,
                                                 d.tool_offsets_m.front(), *std::move(validity));
      });
}

Result<VolumetricModel> tables_from(const ModelDescription& d) {
  Result<ParameterLayout> layout =
      ParameterLayout::with_tables(d.chain, d.nodes, tables_named(d.parameters));
  if (!layout) {
    return failure(layout.error().code, message("model: ", layout.error().text));
  }

  const auto n = static_cast<Eigen::Index>(layout->model_size());
  const Eigen::VectorXd zeros = Eigen::VectorXd::Zero(n);
  const std::vector<Parameter> expected = named(*layout, zeros, Eigen::MatrixXd::Zero(n, n));

  ABBE_TRY(check_parameters(d.parameters, expected));

  Eigen::VectorXd U(n);
  for (std::size_t i = 0; i < d.parameters.size(); ++i) {
    U(static_cast<Eigen::Index>(i)) = d.parameters[i].value;
  }

  Result<ValidityVolume> validity = ValidityVolume::of_vertices(d.validity_hull_m);
  ABBE_TRY(validity);

  return VolumetricModel::from_vector(*layout, d.datum, d.tool_offsets_m, U, d.covariance,
                                      *std::move(validity), d.interpolation);
}

}  // namespace

Result<VolumetricModel> VolumetricModel::from_description(ModelDescription d) {
  ABBE_TRY(check_covariance(d.covariance));

  Result<VolumetricModel> model = d.polynomials ? polynomials_from(d) : tables_from(d);
  if (model && d.misfit) {
    model = model->with_misfit(*std::move(d.misfit));
  }
  if (!model || !d.travel) {
    return model;
  }
  return model->with_travel(*std::move(d.travel));
}

std::vector<Parameter> VolumetricModel::parameters() const {
  return tables() == nullptr ? named(*polynomials()) : named(tables()->layout(), U_, covariance_);
}

ModelDescription VolumetricModel::description() const {
  ModelDescription d;
  d.chain = chain();
  d.nodes = tables() == nullptr ? nodes_ : tables()->layout().nodes();
  d.interpolation = interpolation().value_or(Interpolation::Linear);
  d.datum = datum_;
  d.tool_offsets_m = tool_offsets_m_;
  d.parameters = parameters();
  d.covariance = covariance_;
  d.validity_hull_m.assign(validity_.vertices_m().begin(), validity_.vertices_m().end());

  if (const PolynomialModel* model = polynomials()) {
    d.polynomials = PolynomialForm{model->design().equivalent().order(), model->design().box(),
                                   model->ball1_m()};
  }
  if (travel_) {
    d.travel = travel_->differences;
  }
  d.misfit = misfit_;

  return d;
}

}  // namespace abbe::calib
