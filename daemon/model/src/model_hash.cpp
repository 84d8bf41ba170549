#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstdint>

#include "abbe/base/sha256.hpp"
#include "abbe/calib/model/backlash.hpp"
#include "abbe/model/model_document.hpp"
#include "model_format.hpp"

namespace abbe::daemon {

namespace {

/// Canonical byte stream of a model. Numbers are written as little-endian bytes of IEEE 754
/// doubles; each list and text is preceded by its length, so that different models have different
/// streams. Minus zero is written as zero.
class Canonical {
 public:
  void text(std::string_view value) {
    count(value.size());
    hash_.update(value);
  }
  void count(std::size_t value) { word(static_cast<std::uint64_t>(value)); }
  void number(double value) { word(std::bit_cast<std::uint64_t>(value + 0.0)); }
  void vector(const calib::Vector3& v) {
    for (int i = 0; i < 3; ++i) number(v[i]);
  }
  void vectors(std::span<const calib::Vector3> list) {
    count(list.size());
    for (const auto& v : list) vector(v);
  }
  [[nodiscard]] std::string hex() { return hash_.hex(); }

 private:
  void word(std::uint64_t value) {
    std::array<std::byte, 8> bytes{};
    for (std::size_t i = 0; i < bytes.size(); ++i)
      bytes[i] = static_cast<std::byte>(value >> (8 * i));
    hash_.update(bytes);
  }
  Sha256 hash_;
};

void add_frame(Canonical& out, const calib::VolumetricModel& model) {
  out.text(model.chain().text());
  for (const auto& axis : stored_nodes(model)) {
    out.count(axis.nodes_m.size());
    for (const double node_m : axis.nodes_m) out.number(node_m);
    out.number(axis.reference_m);
  }

  out.text(basis_kind(model));
  if (const auto* polynomials = model.polynomials()) {
    out.count(static_cast<std::size_t>(polynomials->design().equivalent().order()));
    out.vector(polynomials->design().box().centre_m);
    out.vector(polynomials->design().box().half_width_m);
    out.vector(polynomials->ball1_m());
  }

  out.text(name(model.datum()));
  out.vectors(model.tool_offsets_m());
}

void add_values(Canonical& out, const calib::VolumetricModel& model) {
  const auto tables = model.tables() != nullptr ? model.tables()->layout().tables()
                                                : std::span<const calib::Table>{};
  out.count(tables.size());
  for (const auto& table : tables) out.text(name(table.motion));
  const auto& U = model.U();
  const auto& covariance = model.covariance();
  out.count(static_cast<std::size_t>(U.size()));
  for (Eigen::Index i = 0; i < U.size(); ++i) out.number(U[i]);
  for (Eigen::Index i = 0; i < covariance.rows(); ++i)
    for (Eigen::Index j = i; j < covariance.cols(); ++j) out.number(covariance(i, j));
}

/// Adds the thermal expansion of the artefact. It is added last and only if present, so that the
/// hash of a model without it is the same as in earlier versions of abbe.
void add_artefact(Canonical& out, const calib::Expansion& artefact) {
  out.text("artefact");
  for (const double value : {artefact.alpha_per_K, artefact.u_alpha_per_K, artefact.temperature_K,
                             artefact.u_temperature_K})
    out.number(value);
}

/// Adds the differences between the directions of travel. They are added only if V depends on the
/// direction, so that other models have the same hash as in earlier versions.
void add_travel(Canonical& out, const calib::TravelDifferences& travel) {
  out.text("travel");
  out.text(calib::backlash_name(travel.kind));
  out.count(static_cast<std::size_t>(travel.D.size()));
  for (Eigen::Index i = 0; i < travel.D.size(); ++i) {
    out.number(travel.D[i]);
    for (Eigen::Index j = 0; j < travel.cov_U_D.rows(); ++j) out.number(travel.cov_U_D(j, i));
    for (Eigen::Index j = i; j < travel.D.size(); ++j) out.number(travel.covariance(i, j));
  }
}

/// Adds the misfit. It is added only if the model has one, so that other models have the same hash
/// as in earlier versions.
void add_misfit(Canonical& out, const calib::Misfit& misfit) {
  out.text("misfit");
  out.count(static_cast<std::size_t>(misfit.u_of_parameters.size()));
  for (const double u : misfit.u_of_parameters) out.number(u);
  out.vector(misfit.u_V_m);
  out.number(misfit.table_length_m);
  out.number(misfit.V_length_m);
}

/// Adds the place of the tracker. It is added only if the place has a name.
void add_tracker_place(Canonical& out, const calib::TrackerPlace& place) {
  out.text("tracker place");
  out.text(place.name);
  out.number(place.range_offset.value_m);
  out.number(place.range_offset.u_m);
  out.number(place.range_offset.u_prior_m);
  out.count(static_cast<std::size_t>(place.range_offset.dU_dd.size()));
  for (const double derivative : place.range_offset.dU_dd) out.number(derivative);
}

}  // namespace

std::string model_hash(const ModelDocument& document) {
  const auto& model = document.model;
  Canonical out;
  out.text("abbe/model/1");
  out.text(document.method);
  add_frame(out, model);
  add_values(out, model);
  out.vectors(model.validity().vertices_m());
  if (document.artefact) add_artefact(out, *document.artefact);
  if (model.travel() != nullptr) add_travel(out, *model.travel());
  if (model.misfit() != nullptr) add_misfit(out, *model.misfit());
  if (document.tracker_place) add_tracker_place(out, *document.tracker_place);
  return out.hex();
}

std::string model_id(const ModelDocument& document) {
  Canonical out;
  out.text("abbe/model-id/1");
  out.text(model_hash(document));
  out.text(document.machine_hash);
  constexpr std::size_t kDigits = 16;
  return out.hex().substr(0, kDigits);
}

}  // namespace abbe::daemon
