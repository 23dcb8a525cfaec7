//! Types and signatures of rustdoc's JSON as text.

use serde_json::Value;

/// Returns the members of a list.
pub(super) fn each(list: &Value) -> impl Iterator<Item = &Value> {
    list.as_array().into_iter().flatten()
}

/// Writes types; `name` tells the path of a type by its number, and gets the one that was written in the source.
pub(super) struct Writer<'a> {
    pub(super) name: &'a dyn Fn(&Value, &str) -> String,
}

impl Writer<'_> {
    /// Returns the text of a function from its generics to its bounds.
    pub(super) fn function(&self, function: &Value) -> String {
        let sig = &function["sig"];
        let inputs = each(&sig["inputs"]).map(|input| self.input(input));
        let inputs: Vec<String> = inputs.collect();
        let output = match &sig["output"] {
            Value::Null => String::new(),
            output => format!(" -> {}", self.ty(output)),
        };
        let bounds = each(&function["generics"]["where_predicates"])
            .filter_map(|it| it.get("bound_predicate"))
            .map(|it| format!("{}: {}", self.ty(&it["type"]), self.bounds(&it["bounds"])));
        let bounds: Vec<String> = bounds.collect();
        let bounds = match bounds.len() {
            0 => String::new(),
            _ => format!(" where {}", bounds.join(", ")),
        };
        let is_const = function["header"]["is_const"] == true;
        format!(
            "{}fn{}({}){output}{bounds}",
            if is_const { "const " } else { "" },
            self.generics(&function["generics"]),
            inputs.join(", ")
        )
    }

    fn input(&self, input: &Value) -> String {
        let (name, ty) = (text(&input[0]), self.ty(&input[1]));
        match ty.strip_suffix("Self") {
            Some(sign) if name == "self" => format!("{sign}self"),
            _ => format!("{name}: {ty}"),
        }
    }

    /// Returns the parameters in angle brackets, without those that `impl` in an argument stands for.
    pub(super) fn generics(&self, generics: &Value) -> String {
        let params = each(&generics["params"]).filter_map(|param| {
            let (name, kind) = (text(&param["name"]), &param["kind"]);
            if kind["type"]["is_synthetic"] == true {
                return None;
            }
            if let Some(constant) = kind.get("const") {
                return Some(format!("const {name}: {}", self.ty(&constant["type"])));
            }
            match self.bounds(&kind["type"]["bounds"]) {
                bounds if bounds.is_empty() => Some(name.to_owned()),
                bounds => Some(format!("{name}: {bounds}")),
            }
        });
        bracketed(params.collect())
    }

    pub(super) fn bounds(&self, bounds: &Value) -> String {
        let bounds = each(bounds).map(|bound| match bound {
            _ if bound["trait_bound"].is_object() => {
                let sign = match bound["trait_bound"]["modifier"].as_str() {
                    Some("maybe") => "?",
                    _ => "",
                };
                sign.to_owned() + &self.path(&bound["trait_bound"]["trait"])
            }
            _ if bound["outlives"].is_string() => text(&bound["outlives"]).to_owned(),
            _ => format!("use{}", bracketed(self.args(&bound["use"]))),
        });
        bounds.collect::<Vec<_>>().join(" + ")
    }

    fn args(&self, args: &Value) -> Vec<String> {
        let arg = |arg: &Value| match arg {
            Value::String(name) => name.clone(),
            _ if arg["lifetime"].is_string() => text(&arg["lifetime"]).to_owned(),
            _ if arg["const"].is_object() => text(&arg["const"]["expr"]).to_owned(),
            _ => self.ty(&arg["type"]),
        };
        each(args).map(arg).collect()
    }

    /// Returns a path with its arguments.
    pub(super) fn path(&self, path: &Value) -> String {
        let name = (self.name)(&path["id"], text(&path["path"]));
        let args = &path["args"];
        if let Some(called) = args.get("parenthesized") {
            let inputs: Vec<String> = each(&called["inputs"]).map(|it| self.ty(it)).collect();
            let output = match &called["output"] {
                Value::Null => String::new(),
                output => format!(" -> {}", self.ty(output)),
            };
            return format!("{name}({}){output}", inputs.join(", "));
        }
        let mut parts = self.args(&args["angle_bracketed"]["args"]);
        for constraint in each(&args["angle_bracketed"]["constraints"]) {
            let binding = &constraint["binding"];
            let (sign, value) = match binding["equality"].is_object() {
                true => (" = ", self.ty(&binding["equality"]["type"])),
                false => (": ", self.bounds(&binding["constraint"])),
            };
            parts.push(text(&constraint["name"]).to_owned() + sign + &value);
        }
        name + &bracketed(parts)
    }

    /// Returns the text of a type.
    pub(super) fn ty(&self, ty: &Value) -> String {
        let Some((kind, it)) = ty.as_object().and_then(|kinds| kinds.iter().next()) else {
            return "_".to_owned();
        };
        match kind.as_str() {
            "resolved_path" => self.path(it),
            "generic" | "primitive" => text(it).to_owned(),
            "tuple" => {
                let parts: Vec<String> = each(it).map(|part| self.ty(part)).collect();
                format!("({})", parts.join(", "))
            }
            "slice" => format!("[{}]", self.ty(it)),
            "array" => format!("[{}; {}]", self.ty(&it["type"]), text(&it["len"])),
            "impl_trait" => format!("impl {}", self.bounds(it)),
            "dyn_trait" => {
                let traits = each(&it["traits"]).map(|one| self.path(&one["trait"]));
                let lifetime = it["lifetime"].as_str().map(str::to_owned);
                let parts: Vec<String> = traits.chain(lifetime).collect();
                format!("dyn {}", parts.join(" + "))
            }
            "borrowed_ref" => {
                let lifetime = it["lifetime"]
                    .as_str()
                    .map_or(String::new(), |l| format!("{l} "));
                let is_mutable = it["is_mutable"] == true;
                let sign = if is_mutable { "mut " } else { "" };
                format!("&{lifetime}{sign}{}", self.ty(&it["type"]))
            }
            "function_pointer" => self.function(it),
            "qualified_path" => match &it["trait"] {
                Value::Null => format!("{}::{}", self.ty(&it["self_type"]), text(&it["name"])),
                _ => format!(
                    "<{} as {}>::{}",
                    self.ty(&it["self_type"]),
                    self.path(&it["trait"]),
                    text(&it["name"])
                ),
            },
            // Rare ones differ when they change, which is enough.
            _ => ty.to_string(),
        }
    }
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

fn bracketed(parts: Vec<String>) -> String {
    match parts.len() {
        0 => String::new(),
        _ => format!("<{}>", parts.join(", ")),
    }
}
