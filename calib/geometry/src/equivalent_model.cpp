#include "abbe/calib/geometry/equivalent_model.hpp"

#include <algorithm>
#include <map>
#include <numeric>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib {
namespace {

/// One row of W (equivalent_model.hpp), and the components and monomials of A from which it was
/// formed.
struct CombinedRow {
  Eigen::RowVectorXd w;
  std::vector<PolynomialShare> shares;
};

using LikeTerms = std::map<std::pair<std::size_t, Monomial>, Eigen::RowVectorXd>;

LikeTerms like_terms(const ErrorPolynomials& A) {
  LikeTerms found;
  const auto h = static_cast<Eigen::Index>(A.names().size());
  for (const PolynomialTerm& t : A.terms()) {
    Eigen::RowVectorXd& w =
        found.try_emplace({t.component, t.monomial}, Eigen::RowVectorXd::Zero(h)).first->second;
    w(static_cast<Eigen::Index>(t.coefficient)) += t.factor;
  }
  return found;
}

/// Returns +1 for equal rows, -1 for negated rows, else 0. Comparing bits is correct: factors are
/// 0, +-1 or a tool offset, and are copied without arithmetic.
double sign_between(const Eigen::RowVectorXd& a, const Eigen::RowVectorXd& b) {
  return a == b ? 1.0 : (a == -b ? -1.0 : 0.0);
}

std::vector<CombinedRow> combined_rows(const ErrorPolynomials& A) {
  std::vector<CombinedRow> rows;
  for (const auto& [place, w] : like_terms(A)) {
    const auto known = std::find_if(rows.begin(), rows.end(), [&, row = &w](const CombinedRow& r) {
      return sign_between(r.w, *row) != 0.0;
    });
    if (known == rows.end()) {
      rows.push_back({w, {{place.first, place.second, 1.0}}});
    } else {
      known->shares.push_back({place.first, place.second, sign_between(known->w, w)});
    }
  }
  return rows;
}

bool is_translation(const std::string& coefficient) {
  return coefficient.rfind("k_d", 0) == 0;
}

/// Multiplies the row by +1 or -1, so that the factor of a single coefficient is +1, and in a
/// merged row (several coefficients) the factor of a translation is positive. Every merged row
/// contains a translation, because its monomial is constant or of first order, and a translation
/// error function has such a monomial.
void normalise_sign(CombinedRow& row, std::span<const std::string> names) {
  Eigen::Index leading = -1;
  for (Eigen::Index j = 0; j < row.w.size(); ++j) {
    if (row.w(j) != 0.0 && (leading < 0 || is_translation(names[static_cast<std::size_t>(j)]))) {
      leading = j;
    }
  }
  if (row.w(leading) < 0.0) {
    row.w = -row.w;
    for (PolynomialShare& s : row.shares) {
      s.factor = -s.factor;
    }
  }
}

/// Names of the rows of W. `rows` must be those for tool offset zero, with which each row has the
/// fewest coefficients.
std::vector<std::string> row_names(const std::vector<CombinedRow>& rows,
                                   std::span<const std::string> K) {
  std::vector<std::string> names(rows.size());
  std::map<std::size_t, std::vector<std::size_t>> merged;  // key: component; value: indices of rows
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if ((rows[i].w.array() != 0.0).count() > 1) {
      merged[rows[i].shares.front().component].push_back(i);
      continue;
    }
    Eigen::Index only = 0;
    rows[i].w.cwiseAbs().maxCoeff(&only);
    names[i] = K[static_cast<std::size_t>(only)];
  }

  for (auto& [component, members] : merged) {
    std::sort(members.begin(), members.end(), [&](std::size_t a, std::size_t b) {
      return rows[a].shares.front().monomial > rows[b].shares.front().monomial;
    });
    for (std::size_t n = 0; n < members.size(); ++n) {
      names[members[n]] = message("k_eq", "xyz"[component], n + 1);
    }
  }

  return names;
}

/// The row that contains the same component and monomial of A.
const CombinedRow& with_share(const std::vector<CombinedRow>& rows, const PolynomialShare& place) {
  return *std::find_if(rows.begin(), rows.end(), [&](const CombinedRow& r) {
    return std::any_of(r.shares.begin(), r.shares.end(), [&](const PolynomialShare& s) {
      return s.component == place.component && s.monomial == place.monomial;
    });
  });
}

}  // namespace

Result<EquivalentModel> EquivalentModel::of(const KinematicChain& chain, int order,
                                            const Vector3& tool_offset_mm) {
  const Result<ErrorPolynomials> at_zero = ErrorPolynomials::of(chain, order);
  ABBE_TRY(at_zero);

  const Result<ErrorPolynomials> A = ErrorPolynomials::of(chain, order, tool_offset_mm);
  ABBE_TRY(A);

  std::vector<CombinedRow> plain = combined_rows(*at_zero), rows = combined_rows(*A);
  for (CombinedRow& row : plain) {
    normalise_sign(row, A->names());
  }

  for (CombinedRow& row : rows) {
    normalise_sign(row, A->names());
  }

  const std::vector<std::string> names = row_names(plain, A->names());
  std::vector<std::size_t> alphabetical(plain.size());
  std::iota(alphabetical.begin(), alphabetical.end(), std::size_t{0});
  std::sort(alphabetical.begin(), alphabetical.end(),
            [&](std::size_t a, std::size_t b) { return names[a] < names[b]; });
  EquivalentModel model;
  model.chain_ = chain;
  model.order_ = order;
  model.W_.resize(static_cast<Eigen::Index>(plain.size()),
                  static_cast<Eigen::Index>(A->names().size()));

  for (const std::size_t i : alphabetical) {
    const CombinedRow& row = with_share(rows, plain[i].shares.front());
    model.W_.row(static_cast<Eigen::Index>(model.names_.size())) = row.w;
    model.names_.push_back(names[i]);
    model.shares_.push_back(row.shares);
  }

  return model;
}

Eigen::Matrix3Xd EquivalentModel::X(const Vector3& p_mm) const {
  Eigen::Matrix3Xd X = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(size()));
  for (std::size_t j = 0; j < size(); ++j) {
    for (const PolynomialShare& s : shares_[j]) {
      X(static_cast<Eigen::Index>(s.component), static_cast<Eigen::Index>(j)) +=
          s.factor * s.monomial.at(p_mm);
    }
  }
  return X;
}

}  // namespace abbe::calib
