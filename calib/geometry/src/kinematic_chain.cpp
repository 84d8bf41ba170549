#include "abbe/calib/geometry/kinematic_chain.hpp"

#include <cctype>
#include <optional>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib {
namespace {

struct Token {
  std::string name;
  bool primed = false;
  bool fixed = false;  ///< in parentheses: does not move
};

tl::unexpected<Error> broken(std::string_view chain, const std::string& what) {
  return failure(ErrorCode::BadInput, message("chain \"", chain, "\": ", what));
}

std::optional<Axis> linear_axis(const std::string& token) {
  if (token.size() != 1 || token[0] < 'X' || token[0] > 'Z') {
    return std::nullopt;
  }
  return kAllAxes[static_cast<std::size_t>(token[0] - 'X')];
}

/// Either w, b or t alone, or a capital letter followed by digits: A, C1, S, X.
bool is_token(const std::string& s) {
  if (s == "w" || s == "b" || s == "t") {
    return true;
  }
  if (s.empty() || s[0] < 'A' || s[0] > 'Z') {
    return false;
  }
  for (const char c : s.substr(1)) {
    if (std::isdigit(static_cast<unsigned char>(c)) == 0) {
      return false;
    }
  }
  return true;
}

Result<std::vector<Token>> tokens(std::string_view chain) {
  const std::size_t open = chain.find_first_not_of(" \t"), close = chain.find_last_not_of(" \t");
  if (open == std::string_view::npos || chain[open] != '[' || chain[close] != ']') {
    return broken(chain, "must be in brackets, for example [w X' b Y Z (C1) t]");
  }

  std::vector<Token> found;
  std::istringstream words{std::string(chain.substr(open + 1, close - open - 1))};
  for (std::string word; words >> word;) {
    Token token;
    std::string name = word;
    if (name.size() > 2 && name.front() == '(' && name.back() == ')') {
      token.fixed = true;
      name = name.substr(1, name.size() - 2);
    }
    if (name.size() > 1 && name.back() == '\'') {
      token.primed = true;
      name.pop_back();
    }
    if (!is_token(name)) {
      return broken(chain, message("\"", word, "\" is not an axis, w, b or t"));
    }
    token.name = name;
    found.push_back(token);
  }

  return found;
}

Result<void> check_ends(std::string_view chain, const std::vector<Token>& found) {
  if (found.size() < 2 || found.front().name != "w" || found.back().name != "t") {
    return broken(chain, "must begin with w (workpiece) and end with t (tool)");
  }

  std::size_t beds = 0, workpieces = 0, tools = 0;
  for (const Token& token : found) {
    beds += token.name == "b" ? 1 : 0;
    workpieces += token.name == "w" ? 1 : 0;
    tools += token.name == "t" ? 1 : 0;
    if ((token.name == "w" || token.name == "b" || token.name == "t") &&
        (token.primed || token.fixed)) {
      return broken(chain, message(token.name, " is not an axis: no prime, no parentheses"));
    }
  }

  if (beds != 1 || workpieces != 1 || tools != 1) {
    return broken(chain, message("must contain w, b and t once each; found ", workpieces, " w, ",
                                 beds, " b, ", tools, " t"));
  }

  return {};
}

}  // namespace

std::size_t KinematicChain::place(Axis a) const {
  std::size_t i = 0;
  while (order_[i] != a) {
    ++i;
  }
  return i;
}

Result<KinematicChain> KinematicChain::parse(std::string_view chain) {
  const Result<std::vector<Token>> found = tokens(chain);
  ABBE_TRY(found);

  ABBE_TRY(check_ends(chain, *found));

  KinematicChain result;
  result.text_ = std::string(chain);
  std::vector<Axis> order;
  bool after_bed = false;

  for (const Token& token : *found) {
    after_bed = after_bed || token.name == "b";
    if (token.name == "w" || token.name == "b" || token.name == "t") {
      continue;
    }
    if (token.primed == after_bed) {
      return broken(chain, message(token.name, after_bed ? " is after b and must not be primed"
                                                         : " is before b and must be primed"));
    }
    const std::optional<Axis> axis = linear_axis(token.name);
    if (!axis) {
      continue;
    }
    if (token.fixed) {
      return broken(chain, message(token.name, " is in parentheses: X, Y and Z must move"));
    }
    for (const Axis earlier : order) {
      if (earlier == *axis) {
        return broken(chain, message(token.name, " occurs twice"));
      }
    }
    order.push_back(*axis);
  }

  if (order.size() != 3) {
    return broken(chain, message("must contain X, Y and Z; found ", order.size(), " of them"));
  }

  result.order_ = {order[0], order[1], order[2]};
  return result;
}

}  // namespace abbe::calib
