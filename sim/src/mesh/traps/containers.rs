//! Traps of the formats that are containers: GLB and 3MF.

use glam::DVec3;

use super::writing::*;
use super::{check, read};
use crate::mesh::{Mesh, MeshError, MeshFormat};

#[test]
fn nodes_of_a_glb_place_their_meshes() {
    let half = prism(0).moved(DVec3::X * 20.0);
    let inner = r#"{"mesh":0,"translation":[-20,0,0]}"#;
    // A mirror at x = 0 and a turn, moved back, and twice as large and half as large again.
    for nodes in [
        format!(r#"[{inner}],"scenes":[{{"nodes":[0]}}],"#),
        format!(
            r#"[{{"children":[1],"scale":[2,2,2]}},{{"children":[2],"scale":[0.5,0.5,0.5]}},{inner}],
            "scenes":[{{"nodes":[]}},{{"nodes":[0]}}],"scene":1,"#
        ),
        format!(r#"[{{"children":[1],"scale":[1,1,-1]}},{inner}],"scenes":[{{"nodes":[0]}}],"#),
        format!(
            r#"[{{"children":[1],"matrix":[-1,0,0,0,0,1,0,0,0,0,1,0,9,0,0,1]}},{inner}],
            "scenes":[{{"nodes":[0]}}],"#
        ),
    ] {
        check(
            MeshFormat::Glb,
            &glb_with(std::slice::from_ref(&half), &format!("\"nodes\":{nodes}")),
            1,
            0,
        );
    }
    let cycle = r#""nodes":[{"children":[1]},{"children":[0],"mesh":0}],"scenes":[{"nodes":[0]}],"#;
    let refused = read(MeshFormat::Glb, &glb_with(&[prism(0)], cycle)).unwrap_err();
    assert_eq!(refused.to_string(), "GLB file: nodes/0: expected one parent");
    let draco = r#""extensionsRequired":["KHR_draco_mesh_compression"],"#;
    let refused = read(MeshFormat::Glb, &glb_with(&[prism(0)], draco)).unwrap_err();
    assert!(refused.to_string().contains("KHR_draco_mesh_compression"), "{refused}");
    let looks = r#""extensionsRequired":["KHR_materials_unlit"],"#;
    check(MeshFormat::Glb, &glb_with(&[prism(0)], looks), 1, 0);
}

#[test]
fn parts_of_a_3mf_are_placed_and_its_unit_is_its_own() {
    let mesh = mesh_xml(&prism(0));
    let object = format!(r#"<object id="1">{mesh}</object>"#);
    for (unit, metres) in [("micron", 1e-6), ("centimeter", 0.01), ("inch", 0.0254), ("meter", 1.0)]
    {
        let bytes = model(&format!("unit=\"{unit}\""), &object, "<item objectid=\"1\"/>");
        let read = Mesh::read(MeshFormat::ThreeMf, &bytes, None);
        let size = read.unwrap().mesh.largest_dimension();
        assert!((size - 40.0 * metres).abs() < 1e-9 * metres, "{unit}: {size}");
        let other = Mesh::read(MeshFormat::ThreeMf, &bytes, Some(1e-3));
        assert!(matches!(other, Err(MeshError::UnitContradicts { .. })));
    }
    // Two places of one object through a component, the second mirrored.
    let nested = format!(
        r#"{object}<object id="2"><components><component objectid="1"
        transform="1 0 0 0 1 0 0 0 1 -5 0 0"/></components></object>"#
    );
    let items = r#"<item objectid="2" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>
        <item objectid="2" transform="-1 0 0 0 1 0 0 0 1 95 0 0"/>"#;
    check(MeshFormat::ThreeMf, &model("", &nested, items), 2, 0);
    // A model of two parts, as slicers write it.
    let inner = format!("<model><resources>{object}</resources></model>");
    let outer = r#"<model xmlns:p="x/production/1" requiredextensions="p"><resources><object id="9">
        <components><component p:path="/3D/Objects/a.model" objectid="1"/></components></object>
        </resources><build><item objectid="9"/></build></model>"#;
    let parts = [("3D/3dmodel.model", outer), ("3D/Objects/a.model", inner.as_str())];
    check(MeshFormat::ThreeMf, &zipped(&parts), 1, 0);
}

#[test]
fn a_3mf_unpacks_to_no_more_than_its_bounds() {
    let refused = |attributes: &str, objects: &str, items: &str| {
        read(MeshFormat::ThreeMf, &model(attributes, objects, items)).unwrap_err().to_string()
    };
    // Thirty levels, each with the one before twice: a thousand million meshes.
    let mut levels = format!(r#"<object id="0">{}</object>"#, mesh_xml(&prism(0)));
    for level in 1..30 {
        let inner = format!(r#"<component objectid="{}"/>"#, level - 1).repeat(2);
        levels += &format!(r#"<object id="{level}"><components>{inner}</components></object>"#);
    }
    let refusal = refused("", &levels, "<item objectid=\"29\"/>");
    assert!(refusal.contains("components deep"), "{refusal}");
    let refusal = refused("", &levels, &"<item objectid=\"14\"/>".repeat(10));
    assert!(refusal.contains("instances"), "{refusal}");
    // A part longer than the bound, packed to a thousandth.
    let blank = format!("<x/>{}", " ".repeat(900_000)).repeat(300);
    let refusal = read(MeshFormat::ThreeMf, &zipped(&[("3D/3dmodel.model", blank.as_str())]));
    assert!(refusal.unwrap_err().to_string().contains("256 MB"));
    // One comment, text or element as a whole.
    let long = " ".repeat(2_000_000);
    for event in [format!("<!--{long}-->"), long.clone(), format!("<x {long}/>")] {
        let refusal = refused("", &event, "");
        assert!(refusal.contains("at most 1 MB"), "{refusal}");
    }
    let refusal = refused("", &"<object id=\"1\"/><x/>".repeat(10), "<item objectid=\"7\"/>");
    assert!(refusal.contains("the object that an item names"), "{refusal}");
    let refusal = refused("requiredextensions=\"b\" xmlns:b=\"x/beams/1\"", "", "");
    assert!(refusal.contains("x/beams/1"), "{refusal}");
    let plain = zipped(&[("mug.stl", "solid")]);
    let refusal = read(MeshFormat::ThreeMf, &plain).unwrap_err().to_string();
    assert!(refusal.contains("ZIP archive"), "{refusal}");
}

#[test]
fn names_of_a_3mf_are_short_and_kept_once() {
    let long = |n: usize| "a".repeat(n);
    let path = format!(r#"<item objectid="1" path="{}"/>"#, long(2000));
    let name = format!("3D/3dmodel{}.model", long(60_000));
    let required = format!(r#"requiredextensions="{}""#, long(5_000));
    for file in [
        model("", "", &path),
        zipped(&[(name.as_str(), "<model/>")]),
        model(&required, "", ""),
        zipped(&[(format!("3D/3dmodel{}.model", long(900)).as_str(), "<vertex/>")]),
    ] {
        let refusal = read(MeshFormat::ThreeMf, &file).unwrap_err().to_string();
        assert!((100..250).contains(&refusal.chars().count()), "{refusal}");
    }
    let required = format!(r#""extensionsRequired":["{}"],"#, long(5_000));
    let refusal = read(MeshFormat::Glb, &glb_with(&[prism(0)], &required)).unwrap_err();
    assert!(refusal.to_string().len() < 250, "{refusal}");
}

#[test]
fn each_part_of_a_3mf_has_its_own_unit() {
    let inches =
        Solid { vertices: prism(0).vertices.iter().map(|at| *at / 25.4).collect(), ..prism(0) };
    let part = |unit: &str, solid: &Solid| {
        format!(
            r#"<model {unit}><resources><object id="1">{}</object></resources></model>"#,
            mesh_xml(solid)
        )
    };
    // The root is the part that the relations name. It is in inches, moved by 1 and back by 25.4 mm
    // through a part in millimetres; one more part is broken, and not used.
    let root = r#"<model unit="inch" xmlns:p="x/production/1" requiredextensions="p"><resources/>
        <build><item objectid="2" p:path="/3D/middle.model" transform="1 0 0 0 1 0 0 0 1 1 0 0"/>
        <item objectid="1" p:path="/3D/in.model" 
        transform="1 0 0 0 1 0 0 0 1 2.36220472440945 0 0"/>
        </build></model>"#;
    let middle = r#"<model xmlns:p="x/production/1"><resources><object id="2"><components>
        <component objectid="1" p:path="/3D/mm.model" transform="1 0 0 0 1 0 0 0 1 -25.4 0 0"/>
        </components></object></resources></model>"#;
    let relations = r#"<Relationships><Relationship Target="/3D/root.model" Id="r"
        Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#;
    let (mm, inch) = (part("", &prism(0)), part(r#"unit="inch""#, &inches));
    let file = zipped(&[
        ("3D/broken.model", r#"<model unit="furlong" requiredextensions="x"><vertex/></model>"#),
        ("3D/mm.model", &mm),
        ("3D/in.model", &inch),
        ("3D/middle.model", middle),
        ("3D/root.model", root),
        ("_rels/.rels", relations),
    ]);
    let read = read(MeshFormat::ThreeMf, &file).unwrap();
    assert!((read.unit - 0.0254).abs() < 1e-12 && read.mesh.is_watertight());
    let (low, high) = read.mesh.bounds();
    // Two prisms of 40 mm, 60 mm apart.
    let (right_low, right_high) = (DVec3::ZERO, DVec3::new(0.1, 0.04, 0.02));
    assert!(low.distance(right_low) < 1e-9 && high.distance(right_high) < 1e-9, "{low} {high}");
    assert_eq!(read.mesh.triangles().len(), 40);
}

#[test]
fn wrong_indices_of_a_glb_are_named() {
    for (extra, path) in [
        (r#""scene":7,"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}],"#, "scene"),
        (r#""nodes":[{"mesh":9}],"scenes":[{"nodes":[0]}],"#, "nodes[0].mesh"),
        (
            r#""nodes":[{"mesh":0,"children":[3]}],"scenes":[{"nodes":[0]}],"#,
            "nodes[0].children[0]",
        ),
        (r#""nodes":[{"mesh":0}],"scenes":[{"nodes":[5]}],"#, "scenes[0].nodes[0]"),
    ] {
        let refused = read(MeshFormat::Glb, &glb_with(&[prism(0)], extra)).unwrap_err();
        let expected = format!("GLB file: {path}: expected the index of one that exists");
        assert_eq!(refused.to_string(), expected);
    }
    // What only looks need is not looked at.
    let looks = r#""extensionsRequired":["EXT_texture_webp"],"textures":[{"source":4}],
        "nodes":[{"mesh":0,"camera":3}],"scenes":[{"nodes":[0]}],"#;
    check(MeshFormat::Glb, &glb_with(&[prism(0)], looks), 1, 0);
}
