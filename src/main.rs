use photonmill::*;
fn main(){
  let gpu = gpu::Gpu::open(&gpu::Options{validate:true,..Default::default()}).unwrap();
  println!("{:?}", gpu.facts());
  println!("{:?}", gpu::check::loop_count(&gpu, 100000));
  for variant in [settings::Variant::Naive, settings::Variant::Atomic, settings::Variant::Ballot, settings::Variant::Cpu] { for gather in [settings::Gather::Grid, settings::Gather::Brute] {
   let s = settings::Settings{variant, gather, ..Default::default()};
   let scene = scene::open_box::open_box(&s);
   let c = std::sync::atomic::AtomicBool::new(false);
   let mut control = render::Control{cancelled:&c, progress: &mut |_,_|{}};
   let o = if variant==settings::Variant::Cpu { render::on_cpu(&scene,&s,&mut control) } else {render::on_gpu(&gpu,&scene,&s,&mut control)};
   match o { Ok(o)=>{ println!("{variant:?} {gather:?} {:?}", o.fates.ledger()); println!("{:?}", o.fates.bounces.iter().map(|b|b.stored).collect::<Vec<_>>());
     println!("sum {} max {}", o.film.sums.iter().sum::<u64>(), o.film.sums.iter().max().unwrap());
     for r in o.timings.rows() { if !r.name.contains("bounce") {println!("{r:?}")} } }
     Err(e)=>println!("{e}") }
  }}
}
